"""Sampling bridge: takes records shot by shot, and owns the gate in the laser's trigger line.

The device half; the wire half is in `picoradar.drivers.bridge.sbp`.
Source: protocol sheet ``sampling_bridge.md`` (SBP 1.0 and 1.1).
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from picoradar.drivers.bridge import sbp
from picoradar.drivers.bridge.requests import BridgeRequests, gate_name, sampler_status
from picoradar.drivers.bridge.runs import Run, RunReader
from picoradar.drivers.bridge.sbp import ConfigFlag, Configuration, Gate, Request, StatusFlag, WindowEntry
from picoradar.drivers.bridge.sbp.limits import check_table
from picoradar.drivers.bridge.sbp.settings import sweep_configuration, window_configuration
from picoradar.drivers.clock import Clock
from picoradar.drivers.errors import DeviceError, DeviceFault, LimitError, ProtocolError
from picoradar.drivers.interfaces import WATCHDOG_S, Identity, Record, SamplerStatus, SweepSettings, WindowRecord
from picoradar.drivers.links import UsbLink
from picoradar.drivers.traces import Window

WATCHDOG_MS = round(1000 * WATCHDOG_S)
RETRIES = 2


def bridge_link(clock: Clock, *, serial_number: str | None = None, backend: Any = None) -> UsbLink:
    """Make the link to a sampling bridge; a serial number tells several apart."""
    return UsbLink(
        sbp.VENDOR_ID,
        sbp.PRODUCT_ID,
        clock,
        device="sampling bridge",
        serial_number=serial_number,
        interface_class=sbp.INTERFACE_CLASS,
        backend=backend,
    )


class SamplingBridge:
    """Sequential sampling receiver with trigger gate and host watchdog.

    The watchdog closes the gate when `heartbeat` is not called within its time (1 s): the controller calls
    it every quarter of that from a timer of the clock, which runs while this driver waits.

    Parameters
    ----------
    link : UsbLink
        From `bridge_link`.
    retries : int
        How often a spoiled run is taken again before `ProtocolError` is raised.

    Attributes
    ----------
    info, caps
        Identity and limits, as read at opening.
    """

    def __init__(self, link: UsbLink, *, retries: int = RETRIES) -> None:
        self.link = link
        self.retries = retries
        self.info = sbp.Info(0, 0, 0, "", "", sbp.Feature(0))
        self.caps = sbp.Caps()
        self._requests = BridgeRequests(link)
        self._runs = RunReader(self._requests, self.caps, retries)
        self._watchdog_ms = WATCHDOG_MS
        self._configuration: Configuration | None = None
        self._counter = 0

    # Device

    def open(self) -> None:
        """Open the link, read identity and limits, start the watchdog, and close the gate (verified).

        Raises
        ------
        DeviceError
            `LinkLost`, `Timeout`, or `ProtocolError` when it speaks another major version.
        """
        self.link.open()
        try:
            self.info = self._requests.block(Request.GET_INFO, 256, sbp.Info.decode)
            self.caps = self._requests.block(Request.GET_CAPS, 256, sbp.Caps.decode)
            self._runs = RunReader(self._requests, self.caps, self.retries)
            self._configuration = None
            self._requests.errors()
            self._requests.noted.clear()
            self.gate_off()
            self.stop()
            self._watchdog_ms = min(round(self.link.clock.patience_s(WATCHDOG_MS)), self.caps.watchdog_max_ms)
            self._requests.order(Request.SET_WATCHDOG, self._watchdog_ms)
        except DeviceError:
            self.link.close()
            raise

    @property
    def zero_code(self) -> float:
        """Get the A/D code of 0 V."""
        return float(self.caps.zero_code)

    @property
    def mv_per_code(self) -> float:
        """Get the size of an A/D code, mV."""
        return self.caps.nv_per_code * 1e-6

    def close(self) -> None:
        """Close the gate, end the run, release the device; both orders are tried even if one fails."""
        if self.link.is_open:
            with contextlib.suppress(DeviceError):  # without a host the device's own watchdog closes the gate
                self.link.control_out(Request.LASER, 0)
            with contextlib.suppress(DeviceError):
                self.link.control_out(Request.STOP, 1)
        self.link.close()

    def identify(self) -> Identity:
        """Get model, serial number and firmware, as read at opening."""
        high, low = divmod(self.info.firmware, 256)
        return Identity(self.info.model, self.info.serial_number, f"firmware {high}.{low}")

    @property
    def retried(self) -> int:
        """Get how many runs were taken again since opening."""
        return self._runs.retried

    @property
    def supports_windows(self) -> bool:
        """Get whether the device takes records in windows (SBP 1.1)."""
        return bool(self.info.features & sbp.Feature.WINDOWS)

    @property
    def watchdog_s(self) -> float:
        """Get the time limit of the watchdog (s): 1 s of the wall, as far as the device allows."""
        return self._watchdog_ms / 1000

    # Gate and watchdog

    def gate_on(self) -> None:
        """Open the way for triggers to the laser; needs a heartbeat within the last second. Read back.

        Raises
        ------
        DeviceFault
            With the device's reason: interlock open, not configured, locked out, no heartbeat.
        """
        self._requests.order(Request.LASER, 1, sbp.LASER_KEY)
        if (gate := self._requests.status().gate) is not Gate.ON:
            raise DeviceFault(self.link.device, f"gate is {gate_name(gate)} after it was switched on")

    def gate_off(self) -> None:
        """Close the way for triggers to the laser, in every state of the device. Read back."""
        self._requests.order(Request.LASER, 0)
        if self._requests.status().gate is Gate.ON:
            raise DeviceFault(self.link.device, "gate is still on after it was switched off", "cut the interlock chain")

    def clear_lockout(self) -> None:
        """Feed the watchdog and end a lock-out after watchdog or interlock; the gate stays closed.

        Raises
        ------
        DeviceFault
            When the interlock is still open.
        """
        self.heartbeat()
        self._requests.order(Request.LASER, 2, sbp.LASER_KEY)

    def heartbeat(self) -> None:
        """Feed the device's watchdog once."""
        self._counter = (self._counter + 1) & 0xFFFFFFFF
        self._requests.order(Request.HEARTBEAT, 0, struct.pack("<I", self._counter))

    def status(self) -> SamplerStatus:
        """Measure the present state; reads the device's error queue when something is in it."""
        status = self._requests.status()
        if status.flags & StatusFlag.ERROR_QUEUED:
            self._requests.noted.extend(self._requests.errors())
        problems = [str(entry) for entry in self._requests.noted]
        self._requests.noted.clear()
        if status.flags & StatusFlag.WATCHDOG_TRIPPED and not problems:
            problems = ["watchdog has tripped"]
        return sampler_status(status, "; ".join(problems))

    # Records

    def configure(self, sweep: SweepSettings) -> None:
        """Set how records are taken: external trigger, sums in 16 bits. Read back.

        Raises
        ------
        LimitError
            When a value is outside the limits that the device has told; nothing was sent.
        """
        self._configure(sweep_configuration(self.link.device, sweep, self.caps))

    def configure_windows(self, *, prf_hz: float, settle_shots: int, on_advance: bool = False) -> None:
        """Set that records are taken in windows (SBP 1.1), each at an edge of the advance input if asked. Read back.

        Raises
        ------
        LimitError
            When the device has no windows, or a value is outside its limits; nothing was sent.
        """
        if not self.supports_windows:
            raise LimitError(self.link.device, "takes whole sweeps only (SBP 1.0)", "scan in mode sweep")
        self._configure(window_configuration(self.link.device, prf_hz, settle_shots, on_advance, self.caps))

    def take(self, run_id: int, records: int = 1) -> list[Record]:
        """Take that many records in one run.

        Returns
        -------
        list of Record
            In their order; arrays are views of the received bytes.

        Raises
        ------
        DeviceFault
            When the device is not configured for sweeps, has no triggers, or is in fault.
        ProtocolError
            When data were lost or damaged, and again at each retry.
        Timeout
            When the device does not deliver although it should.
        """
        configuration = self._sweep_configuration()
        if configuration.records != records:
            configuration = replace(configuration, records=records)
            self._configure(configuration)
        window = WindowEntry(
            configuration.start_fs, configuration.step_fs, configuration.samples, configuration.averages
        )
        run = Run(run_id, [[window]], records, configuration, _crc(configuration))
        return [record.windows[0] for record in self._runs.take(run)]

    def take_windows(
        self, run_id: int, table: Sequence[Sequence[Window]], *, begin: Callable[[], None] | None = None
    ) -> Iterator[WindowRecord]:
        """Take one record for each row of a window table in one run, and give them as they come.

        Parameters
        ----------
        run_id : int
        table : sequence of sequences of Window
            The windows of each record, equally many in all.
        begin : callable, optional
            Called once the run waits for its first record, and again at each retry: starts the galvo path whose
            marks are wired to the advance input.

        Raises
        ------
        LimitError
            When the table is outside the device's limits; nothing was sent.
        DeviceFault, ProtocolError, Timeout
            As `take`.
        """
        configuration = self._configuration
        if configuration is None or not configuration.flags & ConfigFlag.WINDOWS:
            raise DeviceFault(self.link.device, "is not configured for windows", "call configure_windows first")
        entries = _entries(table)
        check_table(self.link.device, entries, configuration.prf_hz, self.caps)
        return self._runs.take(Run(run_id, entries, len(entries), configuration, _crc(configuration), begin))

    def set_windows(self, table: Sequence[Sequence[Window]]) -> None:
        """Send a window table (SBP 1.1) to the device.

        Raises
        ------
        LimitError
            When it is outside the device's limits; nothing was sent.
        DeviceFault
            When the device refuses it, for instance inside a record.
        """
        prf_hz = self._configuration.prf_hz if self._configuration is not None else self.caps.prf_max_hz
        entries = _entries(table)
        check_table(self.link.device, entries, prf_hz, self.caps)
        self._requests.order(Request.SET_WINDOWS, 0, sbp.encode_windows(entries))

    def stop(self) -> None:
        """End the run at once and empty the queue."""
        self._runs.stop()

    def _sweep_configuration(self) -> Configuration:
        configuration = self._configuration
        if configuration is None or configuration.flags & ConfigFlag.WINDOWS:
            raise DeviceFault(self.link.device, "is not configured for sweeps", "call configure first")
        return configuration

    def _configure(self, configuration: Configuration) -> None:
        block = configuration.encode()
        self._requests.order(Request.SET_CONFIG, 0, block)
        if (found := self.link.control_in(Request.GET_CONFIG, 0, 256)) != block:
            raise ProtocolError(self.link.device, f"configuration reads back as {found.hex(' ')}")
        self._configuration = configuration


def _entries(table: Sequence[Sequence[Window]]) -> list[list[WindowEntry]]:
    return [[WindowEntry.of(window) for window in record] for record in table]


def _crc(configuration: Configuration) -> int:
    return int.from_bytes(configuration.encode()[-4:], "little")
