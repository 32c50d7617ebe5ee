"""Acquisition of the sampling bridge: runs, records and windows.

Source: protocol sheet ``sampling_bridge.md``, sections 2.3, 3 and 10. One timer takes a whole record; its codes are
asked of the signal source when the last shot has been fired.
"""

from __future__ import annotations

from collections import Counter
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.clock import Clock, Timer
from drivers.sbp import Caps, ConfigFlag, Configuration, ErrorCode, EventKind, Format, Gate, State, Window
from drivers.sbp.frames import Frame, FrameFlag
from sim.firmware.bridge_gate import TriggerGate
from sim.firmware.bridge_queue import FrameQueue
from sim.wires import Acquisition, SignalSource, TriggerLine

TRIGGER_POLL_S = 1e-3
RATE_TOLERANCE = 0.02


class Reporter(Protocol):
    """Where asynchronous errors and events go."""

    def error(self, code: ErrorCode, detail: int = 0) -> None:
        """Queue an error that no request caused."""

    def event(self, kind: EventKind, argument: int = 0) -> None:
        """Send an event."""


class Acquirer:
    """Takes records while a run lasts.

    Parameters
    ----------
    clock : Clock
    trigger : TriggerLine
    source : SignalSource
    gate : TriggerGate
    caps : Caps
    reporter : Reporter

    Attributes
    ----------
    state : State
    run_id, records_done : int
        Of the present or last run.
    queue : FrameQueue
        Frames for the host.
    """

    def __init__(
        self,
        clock: Clock,
        trigger: TriggerLine,
        source: SignalSource,
        gate: TriggerGate,
        caps: Caps,
        reporter: Reporter,
    ) -> None:
        self.clock = clock
        self.trigger = trigger
        self.source = source
        self.gate = gate
        self.caps = caps
        self.reporter = reporter
        self.temperature_degc = 23.0
        self.queue = FrameQueue(caps, self._overrun)
        self.state = State.IDLE
        self.configuration: Configuration | None = None
        self.config_crc = 0
        self.run_id = 0
        self.records_done = 0
        self.clipping_seen = False
        self._deliveries: Counter[int] = Counter()
        self._table: list[tuple[Window, ...]] = []
        self._table_row = 0
        self._started = 0.0
        self._record_start = 0.0
        self._record_prf_hz = 0.0
        self._record_flags = FrameFlag(0)
        self._edge_waits = False
        self._overruns = 0
        self._whole = False
        self._rate_reported = False
        self._timer: Timer | None = None

    @property
    def prf_hz(self) -> float:
        """Get the rate of the triggers that the sampler sees now; 0 when there are none."""
        configuration = self.configuration
        if configuration is not None and not configuration.flags & ConfigFlag.EXTERNAL_TRIGGER:
            return float(configuration.prf_hz)
        return self.trigger.rate_hz

    def configure(self, configuration: Configuration | None, crc: int) -> None:
        """Put a checked configuration in force (None: drop it)."""
        self.configuration = configuration
        self.config_crc = crc
        self._table.clear()
        self._table_row = 0

    def set_windows(self, table: list[tuple[Window, ...]]) -> None:
        """Put a checked table of windows in force; a run that waits for one goes on."""
        self._table = table
        self._table_row = 0
        if self.state is State.WAIT:
            self._seek_trigger()

    def start(self, run_id: int) -> None:
        """Start a run: the frame queue is emptied, the sequence number is 0."""
        self.queue.restart()
        self.run_id = run_id
        self.records_done = self._overruns = 0
        self.clipping_seen = self._whole = self._rate_reported = self._edge_waits = False
        self._record_flags = FrameFlag(0)
        self._started = self.clock.now()
        self._enter(State.WAIT)
        self._seek_trigger()

    def stop(self, at_once: bool) -> None:
        """End the run at the end of the record, or at once with the sweeps taken so far."""
        if self.state is State.WAIT:
            self._end_run()
        elif self.state in (State.RUNNING, State.STOPPING):
            if at_once:
                shots = int((self.clock.now() - self._record_start) * self._record_prf_hz + 1e-6)
                self._send_record(shots, last_of_run=True)
                self._end_run()
            else:
                self._enter(State.STOPPING)

    def abandon(self, state: State) -> None:
        """End the run with nothing more to send and enter ``state`` (IDLE or FAULT)."""
        self._cancel()
        self.queue.spoiled = True
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
            self._seek_trigger()
        elif self.state in (State.RUNNING, State.STOPPING):
            self._overruns += 1
            self.reporter.error(ErrorCode.ADVANCE_OVERRUN, self._overruns)

    def take(self) -> bytes | None:
        """Give the next frame to the host."""
        frame = self.queue.take()
        if frame is not None:
            self._count_delivery()
        return frame

    def _seek_trigger(self) -> None:
        """Begin the next record if all it needs is there; look again soon if only the trigger is missing."""
        self._cancel()
        configuration = self.configuration
        if configuration is None or not self._next_windows():
            return
        if configuration.flags & ConfigFlag.ADVANCE and not self._edge_waits:
            return
        if self.prf_hz <= 0:
            self._timer = self.clock.call_at(self.clock.now() + TRIGGER_POLL_S, self._seek_trigger)
            return
        self._edge_waits = False
        self._begin_record(configuration)

    def _next_windows(self) -> tuple[Window, ...]:
        """Get the windows of the next record; empty when the table is used up."""
        configuration = self.configuration
        if configuration is None:
            return ()
        if configuration.flags & ConfigFlag.WINDOWS:
            return self._table[self._table_row] if self._table_row < len(self._table) else ()
        c = configuration
        return (Window(c.start_fs, c.step_fs, c.samples, c.averages),)

    def _begin_record(self, configuration: Configuration) -> None:
        self._record_start = self.clock.now()
        self._record_prf_hz = self.prf_hz
        self._watch_rate(configuration)
        self._enter(State.RUNNING)
        shots = sum(w.sweeps * (configuration.settle_shots + w.samples) for w in self._next_windows())
        self._timer = self.clock.call_at(self._record_start + shots / self._record_prf_hz, self._end_record)

    def _watch_rate(self, configuration: Configuration) -> None:
        off = abs(self._record_prf_hz - configuration.prf_hz) > RATE_TOLERANCE * configuration.prf_hz
        if off and not self._rate_reported:
            self._rate_reported = True
            self.reporter.error(ErrorCode.TRIGGER_RATE, round(self._record_prf_hz * 1000))

    def _end_record(self) -> None:
        configuration = self.configuration
        if configuration is None:
            return
        if self.prf_hz <= 0:  # the triggers stopped inside: the record is taken anew when they are back
            self._record_flags |= FrameFlag.TRIGGER_LOST
            self._edge_waits = True
            self.reporter.error(ErrorCode.TRIGGER_LOST, self.records_done)
            self.reporter.event(EventKind.TRIGGER_LOST, self.records_done)
            if self.state is State.STOPPING:
                self._end_run()
            else:
                self._enter(State.WAIT)
                self._seek_trigger()
            return
        last = self.records_done + 1 == configuration.records or self.state is State.STOPPING
        self._send_record(None, last_of_run=last)
        if last:
            self._end_run()
            return
        self._enter(State.WAIT)
        self._seek_trigger()

    def _end_run(self) -> None:
        self._cancel()
        configuration = self.configuration
        asked = configuration.records if configuration is not None else 0
        self._whole = self.records_done > 0 and asked in (0, self.records_done)
        self._enter(State.IDLE)
        self._count_delivery()

    def _count_delivery(self) -> None:
        """Note that a whole run has reached the host, so that the same run id gives new noise the next time."""
        if self._whole and not self.queue.spoiled and not self.queue:
            self._whole = False
            self._deliveries[self.run_id] += 1

    def _send_record(self, shots: int | None, *, last_of_run: bool) -> None:
        """Queue the frames of the record in hand, of all its shots (None) or of those fired so far."""
        configuration = self.configuration
        if configuration is None:
            return
        windows = list(enumerate(self._next_windows()))
        start_s = self._record_start
        pieces: list[tuple[int, int, NDArray[np.uint32], FrameFlag]] = []
        for number, window in windows:
            per_sweep = configuration.settle_shots + window.samples
            sweeps = window.sweeps if shots is None else min(window.sweeps, shots // per_sweep)
            if sweeps:
                sums, flags = self._acquire(number, window, sweeps, start_s)
                pieces.append((number, sweeps, sums, flags))
            start_s += window.sweeps * per_sweep / self._record_prf_hz
            if shots is not None:
                shots = max(0, shots - window.sweeps * per_sweep)
        for place, (number, sweeps, sums, flags) in enumerate(pieces):
            last = place == len(pieces) - 1
            self._send_window(number, sweeps, sums, flags, place == 0, last, last and last_of_run)
        if pieces:
            self.records_done += 1
            self._table_row += 1
            self._record_flags = FrameFlag(0)
            self.reporter.event(EventKind.RECORD_DONE, self.records_done - 1)

    def _acquire(
        self, number: int, window: Window, sweeps: int, start_s: float
    ) -> tuple[NDArray[np.uint32], FrameFlag]:
        configuration = self.configuration
        if configuration is not None and configuration.flags & ConfigFlag.TEST_PATTERN:
            codes = np.arange(window.samples)[None, :] + np.arange(sweeps)[:, None]
            return (codes % 256).sum(axis=0).astype(np.uint32), FrameFlag.TEST_PATTERN
        wanted = Acquisition(
            key=(self.run_id, self._deliveries[self.run_id], self.records_done, number),
            start_s=start_s,
            prf_hz=self._record_prf_hz,
            delay_ps=window.start_fs / 1000,
            step_ps=window.step_fs / 1000,
            samples=window.samples,
            sweeps=sweeps,
            settle_shots=configuration.settle_shots if configuration is not None else 0,
            gate_open=self.gate.state is Gate.ON and self.gate.changed_at <= self._record_start,
        )
        sums = self.source.acquire(wanted)
        clipped = self.source.clipped
        self.clipping_seen = self.clipping_seen or clipped
        return sums, FrameFlag.CLIPPED if clipped else FrameFlag(0)

    def _send_window(
        self,
        number: int,
        sweeps: int,
        sums: NDArray[np.uint32],
        flags: FrameFlag,
        first: bool,
        last: bool,
        last_of_run: bool,
    ) -> None:
        form = self.configuration.format if self.configuration is not None else Format.U16
        values = (2 * sums + sweeps) // (2 * sweeps) if form == Format.U8 else sums
        per_frame = self.caps.payload_max // (form + 1)
        for index in range(0, len(values), per_frame):
            part_flags = flags | self._record_flags
            if first and index == 0:
                part_flags |= FrameFlag.FIRST
            if last and index + per_frame >= len(values):
                part_flags |= FrameFlag.LAST | (FrameFlag.END_OF_RUN if last_of_run else FrameFlag(0))
            self.queue.put(
                Frame(
                    format=form,
                    flags=int(part_flags),
                    sequence=0,  # the queue counts
                    run_id=self.run_id,
                    record=self.records_done,
                    first=index,
                    device_time_us=round((self._record_start - self._started) * 1e6),
                    sweeps=sweeps,
                    temperature_cdegc=round(self.temperature_degc * 100),
                    config_crc=self.config_crc,
                    window=number,
                    samples=values[index : index + per_frame],
                )
            )

    def _overrun(self, lost: int) -> None:
        self.reporter.error(ErrorCode.OVERRUN, lost)
        self.reporter.event(EventKind.OVERRUN, lost)

    def _enter(self, state: State) -> None:
        if state is not self.state:
            self.state = state
            self.reporter.event(EventKind.STATE, state)

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
