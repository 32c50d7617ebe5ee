"""`Ending`: how a scan ends, whatever happened, and also when its end is itself broken off."""

from __future__ import annotations

from types import TracebackType

from picoradar.drivers.errors import DeviceError, DeviceFault
from picoradar.instrument.controller.context import RunContext
from picoradar.instrument.controller.job import LineStore, ScanOutcome
from picoradar.instrument.errors import InterlockTripped


class Ending:
    """Brings the radar to its safe state, leaves the states of a scan, and closes the recording.

    Used as contexts nested in each other. An exception may be raised at any instant, also here: a second Ctrl-C, memory
    that has run out. The next context then does what is left; what is done already is not done twice.

    Parameters
    ----------
    context : RunContext
    store : LineStore
    outcome : ScanOutcome
        Gets what the safe shutdown found, and the cause of the end.

    Raises
    ------
    InterlockTripped
        When an emergency off was asked for while the scan ended.
    RecordingError
        When the end of a scan that was well could not be recorded.
    """

    def __init__(self, context: RunContext, store: LineStore, outcome: ScanOutcome) -> None:
        self._context = context
        self._clock = context.bench.clock
        self._store = store
        self._outcome = outcome
        self._began_s = self._clock.now()
        self._decided_s: float | None = None
        self._over = False

    def begin_now(self) -> None:
        """Count the scan's time from now."""
        self._began_s = self._clock.now()

    def __enter__(self) -> None:
        """Nothing is to be done before."""

    def __exit__(self, _kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        """Do what is left of the end; the exception goes on."""
        if self._over:
            return
        self._go_dark(error)
        self._leave_states(error)
        self._context.requests.raise_emergency()  # asked for on the way out, when another thread could only ask
        self._record(error)
        self._over = True

    def _go_dark(self, error: BaseException | None) -> None:
        self._context.supervisor.stop_beating()
        outcome = self._outcome
        diode_off = isinstance(error, InterlockTripped) and error.action == "off"
        if outcome.safe.steps and (not diode_off or "diode" in outcome.safe.steps):
            return
        if self._decided_s is None:
            self._decided_s = self._clock.now()
        outcome.safe = self._context.shutdown(blamed=error, diode_off=diode_off)
        outcome.dark_s = self._clock.now() - self._decided_s
        outcome.device_time_s = self._decided_s - self._began_s

    def _leave_states(self, error: BaseException | None) -> None:
        outcome, machine = self._outcome, self._context.machine
        if error is not None:
            outcome.stop_reason = f"{type(error).__name__}: {error}"
        level = self._context.log.info if outcome.safe.laser_off_verified else self._context.log.critical
        level("scan ended", reason=outcome.stop_reason, safe=str(outcome.safe), lines=outcome.lines)
        if error is not None:
            before_light = machine.state == "ready" and isinstance(error, InterlockTripped) and error.action != "off"
            if not before_light:
                machine.fail("; ".join([str(error) or type(error).__name__, *self._behind(error)]))
        elif not outcome.safe.laser_off_verified:
            machine.fail(str(outcome.safe))
        elif machine.state != "ready":
            machine.go("end_scan")

    def _behind(self, error: BaseException) -> list[str]:
        """Find the interlock behind a device's refusal, now that the laser is off."""
        if not isinstance(error, DeviceFault):
            return []
        try:
            self._context.supervisor.poll_all(emitting=False)
        except (InterlockTripped, DeviceError) as found:
            return [str(found)]
        return []

    def _record(self, error: BaseException | None) -> None:
        """Write the end down; after a failure as far as the store can, for it is the failure that is to be raised."""
        outcome = self._outcome
        try:
            self._store.event(self._clock.now(), "safe state", state=self._context.machine.state, **outcome.safe.steps)
            self._store.finish(
                outcome.stop_reason,
                laser_off_verified=outcome.safe.laser_off_verified,
                device_time_s=outcome.device_time_s,
                flags=dict(outcome.flags),
                suspended=outcome.suspended,
            )
        except Exception as failed:
            if error is None and outcome.safe.laser_off_verified:
                raise
            self._context.log.error("the end of the scan could not be recorded", error=repr(failed))
