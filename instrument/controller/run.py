"""One scan from the first poll of the interlocks to the verified safe state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from picoradar.instrument.controller.context import RunContext, reach_working_point
from picoradar.instrument.controller.disk import lines_left, refuse_small_disk
from picoradar.instrument.controller.ending import Ending
from picoradar.instrument.controller.job import STATE_EVENT, SUPERVISION, LineStore, ScanJob, ScanOutcome, Sink, ZeroJob
from picoradar.instrument.controller.recovery import LIMIT_S, LINK_ERRORS, apply_settings, reopen, waits
from picoradar.instrument.controller.requests import AFTER_LINE, EndScan
from picoradar.instrument.controller.subscribers import Subscribers, Subscription
from picoradar.instrument.errors import InterlockTripped
from picoradar.instrument.line import ScanLine

T = TypeVar("T")

PAUSE_POLL_S = 0.1
SUSPEND_LIMIT_S = 600.0
SUSPENSIONS_PER_LINE = 3  # a line that is broken off again and again is not worth another try


class ScanRun:
    """Takes the lines of a job one after the other; knows how to wait, to recover, and to end.

    Parameters
    ----------
    context : RunContext
    job : ScanJob
    store : LineStore
        Each line is stored before it is handed on.
    sinks : sequence of callables or Subscription
        Get each stored line; one that raises is left out from then on.
    """

    def __init__(
        self, context: RunContext, job: ScanJob, store: LineStore, sinks: Sequence[Sink | Subscription]
    ) -> None:
        self.outcome = ScanOutcome()
        self._context = context
        self._bench = context.bench
        self._clock = context.bench.clock
        self._job = job
        self._store = store
        self._subscribers = Subscribers(sinks, context.log, in_line=not self._clock.real_time)
        self._ending = Ending(context, store, self.outcome)
        self._settled = self._zero_checked = self._has_mark = False
        context.requests.forget("registered")  # that came too late for the scan before

    def run(self) -> ScanOutcome:
        """Take all lines; whatever happens, end with the safe shutdown and write its outcome down.

        Raises
        ------
        InterlockTripped, DeviceError, RecordingError
            After the safe shutdown, with the state at ``fault`` (or still ``ready``, when it was refused before light).
        """
        try:
            with self._ending, self._ending, self._ending:  # three, since an end may be broken off, and that one again
                self._take_lines()
        finally:
            self.outcome.sinks = self._subscribers.finish()  # it is dark: they may take their time
        return self.outcome

    def _take_lines(self) -> None:
        try:
            self._context.requests.at_point()  # who has asked to stop already gets no light at all
            if self._job.rows:
                self._begin()
            self._take_rows()
            self._check_zero_again()
        except EndScan as end:
            self.outcome.stop_reason = str(end)

    def _take_rows(self) -> None:
        try:
            for row in self._job.rows:
                self._run_up(row)
                self._keep(self._take(row))
        except EndScan as end:
            if str(end) not in AFTER_LINE.values() or self._context.machine.state != "scanning":
                raise
            self.outcome.stop_reason = str(end)  # with the laser still on, so that the zero is checked as ever

    # ---- light

    def _begin(self) -> None:
        refuse_small_disk(self._job, self._store)
        self._wait_for_interlocks()
        apply_settings(self._bench, self._context.settings, self._job)
        self._light_on("start_scan")

    def _light_on(self, verb: str) -> None:
        """Everything but the gate first, so that the gate is open only in ``scanning``."""
        self._context.supervisor.start_beating()
        self._bench.pulser.on()
        self._context.machine.go(verb, self._bench.sampler.gate_on)
        self._store.event(self._clock.now(), "laser on", state=self._context.machine.state)
        self._settled = False

    def _settle(self) -> None:
        """Wait for the working point, and before the first line check the range zero."""
        if self._settled:
            return
        if not reach_working_point(self._context, self._between):
            self._store.event(self._clock.now(), "working point not reached")
        self._settled = True
        if not self._zero_checked:
            self._check_zero()
        if not self.outcome.lines:
            self._ending.begin_now()  # until here the radar got ready; from here on it scans

    # ---- lines

    def _take(self, row: int) -> ScanLine:
        def line() -> ScanLine:
            self._context.supervisor.poll_before_line(lambda: lines_left(self._job, self._store))
            line = self._job.take_line(row, self._bench.galvo, self._bench.sampler, self._between)
            self._context.supervisor.judge_line(*self._job.reference)
            return line

        return self._unbroken(line)

    def _check_zero(self) -> None:
        """Measure the mark of known range, if the job has one; what it tells is judged later, by any calibration."""
        if isinstance(self._job, ZeroJob):
            reading = self._job.take_zero(self._bench.galvo, self._bench.sampler, self._between)
            self._has_mark = reading is not None
            if reading is not None:
                self._store.append_zero(reading)
        self._zero_checked = True

    def _check_zero_again(self) -> None:
        """Measure the mark after the last line, while there is light."""
        while self._has_mark and self._context.machine.state == "scanning":
            try:
                self._unbroken(self._check_zero)
                return
            except EndScan as end:
                if str(end) not in AFTER_LINE.values():  # who asks for that now gets it: no line is left
                    raise

    def _unbroken(self, step: Callable[[], T]) -> T:
        """Do a step with the laser on, again after each wait; what was broken off is dropped whole."""
        suspensions = 0
        while True:
            try:
                if self._context.requests.at_line():
                    self._pause()
                self._settle()
                return step()
            except (InterlockTripped, *LINK_ERRORS) as error:
                cause = self._context.supervisor.first_failure(error)
                suspensions += 1
                grave = isinstance(cause, InterlockTripped) and cause.action != "suspend"
                if grave or suspensions > SUSPENSIONS_PER_LINE:
                    raise cause from (None if cause is error else error)
                self._suspend(cause)

    def _run_up(self, row: int) -> None:
        """Where a scan goes on after a stop, take the lines before again and drop them, so that all is as it was."""
        if not self._job.goes_on_at(row):
            return
        for again in self._job.run_up(row):
            self._recall(again)
            self._take(again)
        self._recall(row)

    def _recall(self, row: int) -> None:
        self._context.supervisor.load_state(self._job.recall(row).get(SUPERVISION, {}))

    def _keep(self, line: ScanLine) -> None:
        if state := self._job.state_dict():  # before the line: whoever finds the line finds what comes after it
            state = {"line": line.index, SUPERVISION: self._context.supervisor.state_dict(), **state}
            self._store.event(self._clock.now(), STATE_EVENT, **state)
        self._store.append(line, acknowledged_at_s=self._clock.now())
        self.outcome.count(line)
        self._subscribers.take(line)

    def _between(self) -> None:
        self._context.requests.at_point()
        self._context.supervisor.poll()

    def _poll(self, *, emitting: bool) -> None:
        self._context.supervisor.poll_all(emitting=emitting, disk_lines=lambda: lines_left(self._job, self._store))

    # ---- waiting without light

    def _pause(self) -> None:
        """Laser off between two lines until somebody asks to go on (or to end)."""
        self._go_dark("pause", None)
        while not self._context.requests.at_rest():
            self._clock.wait(self._context.requests.waiting, PAUSE_POLL_S)
        self._wait_for_interlocks()
        apply_settings(self._bench, self._context.settings, self._job)
        self._light_on("resume")

    def _suspend(self, cause: Exception) -> None:
        """Laser off until links and interlocks are well again, or the limit has passed."""
        self.outcome.suspended.append(str(cause))
        self._go_dark("suspend", cause)
        limit_s = LIMIT_S if isinstance(cause, LINK_ERRORS) else SUSPEND_LIMIT_S
        end = self._clock.now() + limit_s
        for wait_s in waits():
            self._rest(wait_s)
            try:
                reopen(self._bench, self._context.settings, self._context.known, self._context.log)
                self._poll(emitting=False)
                apply_settings(self._bench, self._context.settings, self._job)
                self._light_on("recover")
                return
            except LINK_ERRORS as lost:
                if self._context.machine.state != "suspended" or self._clock.now() >= end:
                    raise
                self._context.supervisor.stop_beating()
                self._context.log.info("link still away", cause=str(lost))
            except InterlockTripped as held:
                if held.action != "suspend" or self._clock.now() >= end:
                    raise

    def _wait_for_interlocks(self) -> None:
        """Wait, without light, for the interlocks that may come back by themselves."""
        end = self._clock.now() + SUSPEND_LIMIT_S
        while True:
            try:
                self._poll(emitting=False)
                return
            except InterlockTripped as held:
                if held.action != "suspend":
                    raise
                if self._clock.now() >= end:
                    raise InterlockTripped(held.interlock, f"{held}; for {SUSPEND_LIMIT_S:g} s") from held
                self._rest(1.0)

    def _rest(self, wait_s: float) -> None:
        self._clock.wait(self._context.requests.waiting, wait_s)
        self._context.requests.at_point()

    def _go_dark(self, verb: str, cause: Exception | None) -> None:
        self._context.supervisor.rest()
        safe = self._context.shutdown(blamed=cause)
        self._context.machine.go(verb)
        self._store.event(
            self._clock.now(), verb, state=self._context.machine.state, cause=str(cause or ""), **safe.steps
        )
        self._context.log.warning(verb, cause=str(cause or ""), safe=str(safe))
        if not safe.laser_off_verified:
            raise InterlockTripped(verb, str(safe), action="off")
