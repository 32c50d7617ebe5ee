"""Runs of the sampling bridge: start, read, retry.

Source: protocol sheet ``sampling_bridge.md``, section 3, framing rules 3 to 7.
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from picoradar.drivers.bridge.requests import BridgeRequests
from picoradar.drivers.bridge.sbp import (
    EP_DATA,
    Caps,
    ConfigFlag,
    Configuration,
    ErrorCode,
    FrameParser,
    Request,
    State,
    StatusFlag,
    WindowEntry,
    encode_windows,
)
from picoradar.drivers.bridge.sbp.records import CorruptedRun, RecordAssembler
from picoradar.drivers.errors import DeviceError, DeviceFault, ProtocolError, Stall, Timeout
from picoradar.drivers.interfaces import WindowRecord

QUIET_S = 0.5  # a run is late when nothing comes for the time of 3 records plus this
PACKET = 512


@dataclass(frozen=True)
class Run:
    """What one run is to take.

    Attributes
    ----------
    run_id : int
    table : sequence of sequences of WindowEntry
        Windows of each record; the last row applies to all further records.
    records : int
    configuration : Configuration
        As set in the device.
    config_crc : int
        Its check sum, which every frame carries.
    begin : callable, optional
        Called once the run has been started, at each attempt.
    """

    run_id: int
    table: Sequence[Sequence[WindowEntry]]
    records: int
    configuration: Configuration
    config_crc: int
    begin: Callable[[], None] | None = None

    @property
    def limit_s(self) -> float:
        """Get how long the host waits for data before the run is late (rule 6)."""
        settle = self.configuration.settle_shots
        shots = max(sum(w.sweeps * (settle + w.samples) for w in row) for row in self.table)
        return 3 * shots / self.configuration.prf_hz + QUIET_S


class RunReader:
    """Takes runs; a corrupted one is taken again under the same run id.

    Parameters
    ----------
    requests : BridgeRequests
    caps : Caps
    retries : int

    Attributes
    ----------
    retried : int
        Runs taken again so far.
    """

    def __init__(self, requests: BridgeRequests, caps: Caps, retries: int) -> None:
        self.retried = 0
        self._requests = requests
        self._link = requests.link
        self._caps = caps
        self._retries = retries
        self._parser = FrameParser(caps.payload_max)
        # One packet more than the longest frame, so that a zero-length packet at its end is read with it.
        self._read_size = ((caps.header_length + caps.payload_max + 4) // PACKET + 1) * PACKET

    def stop(self) -> None:
        """End the run in the device at once, and empty all queues."""
        self._requests.order(Request.STOP, 1)
        self._requests.order(Request.FLUSH, 0)
        self._parser.clear()

    def take(self, run: Run) -> Iterator[WindowRecord]:
        """Yield the records of a run as they come; a retry does not yield the same record twice.

        Raises
        ------
        ProtocolError
            When the run was corrupted at each attempt.
        DeviceFault, Timeout
            When no data come; the run is ended.
        """
        given = 0
        for left in range(self._retries, -1, -1):
            try:
                for record in self._attempt(run):
                    if record.number >= given:
                        given += 1
                        yield record
                return
            except CorruptedRun as corrupted:
                self.stop()
                if not left:
                    raise ProtocolError(
                        self._link.device,
                        f"run {run.run_id} was corrupted {self._retries + 1} times, last: {corrupted}",
                        "check the USB cable and the load of this computer",
                    ) from corrupted
                self.retried += 1
            except (DeviceFault, Timeout, GeneratorExit):
                with contextlib.suppress(DeviceError):  # the first error is the one that matters
                    self.stop()
                raise

    def _attempt(self, run: Run) -> Iterator[WindowRecord]:
        windows = bool(run.configuration.flags & ConfigFlag.WINDOWS)
        if windows:
            self._requests.order(Request.SET_WINDOWS, 0, encode_windows(run.table))
        assembler = RecordAssembler(self._caps, run.run_id, run.config_crc, run.table)
        self._requests.order(Request.START, 0, struct.pack("<I", run.run_id))
        if run.begin is not None:
            run.begin()
        done = 0
        while done < run.records:
            damaged = self._parser.damaged
            for frame in self._parser.feed(self._read(run.limit_s)):
                record = assembler.add(frame)
                if record is not None:
                    done += 1
                    yield record
            if self._parser.damaged > damaged and done < run.records:
                raise CorruptedRun("a frame was corrupted")
        if windows:  # such a run has no end of its own: it would wait for another table
            self._requests.order(Request.STOP, 1)

    def _read(self, limit_s: float) -> bytes:
        try:
            return self._link.read(EP_DATA, self._read_size, timeout_s=limit_s)
        except Stall as stall:
            self._link.clear_halt(EP_DATA)
            raise CorruptedRun("the data endpoint stalled") from stall
        except ProtocolError as odd:  # for instance more bytes than the longest frame has
            raise CorruptedRun(odd.what) from odd
        except Timeout as late:
            self._explain(late, limit_s)
            raise

    def _explain(self, late: Timeout, limit_s: float) -> None:
        """Ask the device why no data came, and raise the fitting error."""
        status = self._requests.status()
        device = self._link.device
        if status.state is State.FAULT or status.flags & StatusFlag.WATCHDOG_TRIPPED:
            errors = ", ".join(map(str, self._requests.errors())) or "no error queued"
            remedy = "find the cause, then clear the lock-out"
            code = int(ErrorCode.WATCHDOG_TRIPPED)
            raise DeviceFault(device, f"is in state {status.state.name}: {errors}", remedy, code=code) from late
        if not status.flags & StatusFlag.TRIGGER_PRESENT:
            remedy = "start the delay generator, check its cable"
            code = int(ErrorCode.TRIGGER_LOST)
            raise DeviceFault(device, f"no triggers came within {limit_s:.1f} s", remedy, code=code) from late
        if status.state is State.IDLE:
            raise CorruptedRun(f"the run has ended and {status.frames_lost} frames were lost") from late
