"""Acquisition of the sampling bridge: runs, and when their records begin and end.

Source: protocol sheet ``sampling_bridge.md``, sections 2 and 10. One timer takes a whole record; its codes are
requested from the signal source when the last shot has been fired.
"""

from __future__ import annotations

from collections import Counter

from picoradar.drivers.bridge.sbp import (
    Caps,
    ConfigFlag,
    Configuration,
    ErrorCode,
    EventKind,
    FrameFlag,
    State,
    WindowEntry,
)
from picoradar.drivers.clock import Clock, Timer
from picoradar.sim.firmware.bridge.gate import TriggerGate
from picoradar.sim.firmware.bridge.queue import FrameQueue
from picoradar.sim.firmware.bridge.record import Record, RecordTaker, WindowTable
from picoradar.sim.firmware.bridge.reports import Reports
from picoradar.sim.wires import SignalSource, TriggerLine

TRIGGER_POLL_S = 1e-3
RATE_TOLERANCE = 0.02


class Acquirer:
    """Takes records while a run lasts.

    Parameters
    ----------
    clock, trigger, source, gate, caps, reports
        As of the firmware.

    Attributes
    ----------
    state : State
    run_id, records_done : int
        Of the present or last run.
    queue : FrameQueue
        Frames for the host.
    taker : RecordTaker
    """

    def __init__(
        self,
        clock: Clock,
        trigger: TriggerLine,
        source: SignalSource,
        gate: TriggerGate,
        caps: Caps,
        reports: Reports,
    ) -> None:
        self.state = State.IDLE
        self.configuration: Configuration | None = None
        self.run_id = 0
        self.records_done = 0
        self.queue = FrameQueue(caps, self._overrun)
        self.taker = RecordTaker(source, gate, caps.payload_max)
        self._clock = clock
        self._trigger = trigger
        self._reports = reports
        self._config_crc = 0
        self._deliveries: Counter[int] = Counter()
        self._table = WindowTable()
        self._run_start_s = 0.0
        self._record: Record | None = None
        self._next_flags = FrameFlag(0)
        self._edge_waits = False
        self._edges_lost = 0
        self._whole = False
        self._rate_reported = False
        self._timer: Timer | None = None

    @property
    def prf_hz(self) -> float:
        """Get the rate of the triggers that the sampler sees now; 0 when there are none."""
        configuration = self.configuration
        if configuration is not None and not configuration.flags & ConfigFlag.EXTERNAL_TRIGGER:
            return float(configuration.prf_hz)
        return self._trigger.rate_hz

    def configure(self, configuration: Configuration | None, crc: int) -> None:
        """Activate a checked configuration (None: drop the present one)."""
        self.configuration = configuration
        self._config_crc = crc
        self._table.fill([])

    def set_windows(self, table: list[tuple[WindowEntry, ...]]) -> None:
        """Activate a checked table of windows; a run that waits for one continues."""
        self._table.fill(table)
        if self.state is State.WAIT:
            self._seek_start()

    def start(self, run_id: int) -> None:
        """Start a run: the frame queue is emptied, the sequence number is 0."""
        self.queue.restart()
        self.run_id = self._reports.run_id = run_id
        self.records_done = self._edges_lost = 0
        self._whole = self._rate_reported = self._edge_waits = self.taker.clipping_seen = False
        self._next_flags = FrameFlag(0)
        self._run_start_s = self._clock.now()
        self._enter(State.WAIT)
        self._seek_start()

    def stop(self, *, at_once: bool) -> None:
        """End the run at the end of the record, or at once with the sweeps taken so far."""
        if self.state is State.WAIT:
            self._end_run()
        elif self.state in (State.RUNNING, State.STOPPING):
            if at_once:
                self._send_record(last_of_run=True)
                self._end_run()
            else:
                self._enter(State.STOPPING)

    def abandon(self, state: State) -> None:
        """End the run, send nothing more and enter ``state`` (IDLE or FAULT)."""
        self._cancel()
        self.queue.corrupted = True
        self._enter(state)

    def reset(self) -> None:
        """Drop run, configuration and queue."""
        self.abandon(State.IDLE)
        self.queue.flush()
        self.configure(None, 0)

    def advance(self) -> None:
        """Take a rising edge of the advance input."""
        configuration = self.configuration
        if configuration is None or not configuration.flags & ConfigFlag.ADVANCE:
            return
        if self.state is State.WAIT:
            self._edge_waits = True
            self._seek_start()
        elif self.state in (State.RUNNING, State.STOPPING):
            self._edges_lost += 1
            self._reports.error(ErrorCode.ADVANCE_OVERRUN, self._edges_lost)

    def take(self) -> bytes | None:
        """Give the next frame to the host."""
        frame = self.queue.take()
        if frame is not None:
            self._count_delivery()
        return frame

    def _seek_start(self) -> None:
        """Begin the next record if everything is there; try again soon if only the trigger is missing."""
        self._cancel()
        configuration = self.configuration
        windows = self._table.windows(configuration)
        if configuration is None or not windows:
            return
        if configuration.flags & ConfigFlag.ADVANCE and not self._edge_waits:
            return
        if self.prf_hz <= 0:
            self._timer = self._clock.call_at(self._clock.now() + TRIGGER_POLL_S, self._seek_start)
            return
        self._edge_waits = False
        self._check_rate(configuration)
        self._record = Record(
            run_id=self.run_id,
            repeat=self._deliveries[self.run_id],
            number=self.records_done,
            windows=windows,
            configuration=configuration,
            config_crc=self._config_crc,
            run_start_s=self._run_start_s,
            start_s=self._clock.now(),
            prf_hz=self.prf_hz,
            flags=self._next_flags,
        )
        self._enter(State.RUNNING)
        self._timer = self._clock.call_at(self._record.end_s, self._end_record)

    def _check_rate(self, configuration: Configuration) -> None:
        off = abs(self.prf_hz - configuration.prf_hz) > RATE_TOLERANCE * configuration.prf_hz
        if off and not self._rate_reported:
            self._rate_reported = True
            self._reports.error(ErrorCode.TRIGGER_RATE, round(self.prf_hz * 1000))

    def _end_record(self) -> None:
        stopping = self.state is State.STOPPING
        if self.prf_hz <= 0:
            # The triggers stopped during the record: it is taken again when they are back.
            self._next_flags |= FrameFlag.TRIGGER_LOST
            self._edge_waits = True
            self._reports.error(ErrorCode.TRIGGER_LOST, self.records_done)
            self._reports.event(EventKind.TRIGGER_LOST, self.records_done)
        else:
            asked = self.configuration.records if self.configuration is not None else 0
            stopping = stopping or self.records_done + 1 == asked
            self._send_record(last_of_run=stopping)
        if stopping:
            self._end_run()
        else:
            self._enter(State.WAIT)
            self._seek_start()

    def _send_record(self, *, last_of_run: bool) -> None:
        """Queue the frames of what has been taken of the record in hand."""
        if self._record is None:
            return
        frames = self.taker.frames(self._record, self._clock.now())
        for frame in frames:
            ends = last_of_run and frame is frames[-1]
            self.queue.put(frame._replace(flags=frame.flags | FrameFlag.END_OF_RUN) if ends else frame)
        if frames:
            self.records_done += 1
            self._table.row += 1
            self._next_flags = FrameFlag(0)
            self._reports.event(EventKind.RECORD_DONE, self.records_done - 1)

    def _end_run(self) -> None:
        self._cancel()
        asked = self.configuration.records if self.configuration is not None else 0
        self._whole = self.records_done > 0 and asked in (0, self.records_done)
        self._enter(State.IDLE)
        self._count_delivery()

    def _count_delivery(self) -> None:
        """Note that a whole run has reached the host, so that the same run id gives new noise the next time."""
        if self._whole and not self.queue.corrupted and not self.queue:
            self._whole = False
            self._deliveries[self.run_id] += 1

    def _overrun(self, lost: int) -> None:
        self._reports.error(ErrorCode.OVERRUN, lost)
        self._reports.event(EventKind.OVERRUN, lost)

    def _enter(self, state: State) -> None:
        if state is not self.state:
            self.state = state
            self._reports.event(EventKind.STATE, state)

    def _cancel(self) -> None:
        self._record = None
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
