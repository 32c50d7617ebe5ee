"""Sampling bridge: takes records shot by shot, and owns the gate in the laser's trigger line.

The wire format is in `picoradar.drivers.bridge.sbp`.
Source: protocol sheet ``sampling_bridge.md`` (SBP 1.0 and 1.1).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from picoradar.drivers.bridge import sbp
from picoradar.drivers.bridge.gate import WATCHDOG_MS, TriggerGate
from picoradar.drivers.bridge.runs import Run, RunReader
from picoradar.drivers.bridge.sbp import ConfigFlag, Configuration, Request, WindowEntry
from picoradar.drivers.bridge.sbp.limits import check_table
from picoradar.drivers.bridge.sbp.settings import sweep_configuration, window_configuration
from picoradar.drivers.clock import Clock
from picoradar.drivers.errors import DeviceError, DeviceFault, LimitError, ProtocolError
from picoradar.drivers.interfaces import Identity, Record, SweepSettings, WindowRecord
from picoradar.drivers.links import UsbIdentity, UsbLink
from picoradar.drivers.traces import Window

RETRIES = 2


def bridge_link(clock: Clock, *, serial_number: str | None = None, backend: object | None = None) -> UsbLink:
    """Make the link to a sampling bridge; where there are several, give a serial number."""
    identity = UsbIdentity(sbp.VENDOR_ID, sbp.PRODUCT_ID, serial_number, sbp.INTERFACE_CLASS)
    return UsbLink(identity, clock, device="sampling bridge", backend=backend)


class SamplingBridge(TriggerGate):
    """Sequential sampling receiver with trigger gate and host watchdog.

    Parameters
    ----------
    link : UsbLink
        From `bridge_link`.
    retries : int
        How often a corrupted run is taken again before `ProtocolError` is raised.

    Attributes
    ----------
    info, caps
        Identity and limits, as read at opening.
    """

    found_on: tuple[str, ...] = ()  # at opening

    def __init__(self, link: UsbLink, *, retries: int = RETRIES) -> None:
        super().__init__(link)
        self.retries = retries
        self.info = sbp.Info(0, 0, 0, "", "", sbp.Feature(0))
        self.caps = sbp.Caps()
        self._runs = RunReader(self._requests, self.caps, retries)
        self._configuration: Configuration | None = None

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
            self.found_on = ("gate",) if self._requests.status().gate is sbp.Gate.ON else ()
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
        """Close the gate, end the run and release the device; both requests are sent even if one fails."""
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
        """Get the number of runs that were taken again since opening."""
        return self._runs.retried

    @property
    def supports_windows(self) -> bool:
        """Get whether the device can take records in windows (SBP 1.1)."""
        return bool(self.info.features & sbp.Feature.WINDOWS)

    # Records

    def configure(self, sweep: SweepSettings) -> None:
        """Take records in whole sweeps: external trigger, sums in 16 bits. Read back.

        Raises
        ------
        LimitError
            When a value is outside the limits that the device has reported; nothing was sent.
        """
        self._configure(sweep_configuration(self.link.device, sweep, self.caps))

    def configure_windows(self, *, prf_hz: float, settle_shots: int, on_advance: bool = False) -> None:
        """Take records in windows (SBP 1.1), with ``on_advance`` each at an edge of the advance input. Read back.

        Parameters
        ----------
        prf_hz : float
            Rate of the external trigger.
        settle_shots : int
            Shots discarded before each sweep.
        on_advance : bool
            Whether each record waits for an edge of the advance input.

        Raises
        ------
        LimitError
            When the device has no windows, or a value is outside its limits; nothing was sent.
        """
        if not self.supports_windows:
            raise LimitError(self.link.device, "takes whole sweeps only (SBP 1.0)", "scan in mode sweep")
        configuration = window_configuration(
            self.link.device, self.caps, prf_hz=prf_hz, settle_shots=settle_shots, on_advance=on_advance
        )
        self._configure(configuration)

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
            When data were lost or corrupted, and again at each retry.
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
        """Take one record for each row of a window table in one run, and yield them as they come.

        Parameters
        ----------
        run_id : int
        table : sequence of sequences of Window
            The windows of each record; the same number in every record.
        begin : callable, optional
            Called once the run waits for its first record, and again at each retry: starts the galvo path whose
            markers are wired to the advance input.

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
            When the device refuses it, for instance during a record.
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
