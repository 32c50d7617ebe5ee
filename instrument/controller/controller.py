"""The controller: verbs of the radar, one owner of all devices, and a safe way out of everything."""

from __future__ import annotations

import itertools
import queue
from collections.abc import Callable, Iterable
from typing import Literal

from drivers.errors import DeviceError
from drivers.interfaces import Identity, TemperatureStatus
from instrument.bench import Bench
from instrument.controller.interlocks import interlocks
from instrument.controller.job import LineStore, ScanJob, ScanOutcome, Sink
from instrument.controller.machine import StateMachine
from instrument.controller.safety import SafeState, make_safe
from instrument.controller.states import State
from instrument.controller.supervision import Supervisor
from instrument.errors import InterlockTripped, Interrupted
from instrument.events import logger
from instrument.scan_line import Flag, ScanLine
from instrument.settings import Settings

Request = Literal["finish", "pause", "resume", "abort", "interrupt", "emergency off"]
WARM_POLL_S = 1.0
PAUSE_POLL_S = 0.1

_numbers = itertools.count(1)


class _EndScan(Exception):
    """Leave the scanning loop at this place, for the reason given."""


class Controller:
    """Runs one bench.

    All verbs are called from one thread, which owns the devices. `request` alone may be called from any thread or
    from a signal handler: what it asks for is carried out between two places of the raster.

    Parameters
    ----------
    bench : Bench
        The devices, not yet opened.
    settings : Settings
        Checked settings of the run.
    """

    def __init__(self, bench: Bench, settings: Settings) -> None:
        self.bench = bench
        self.settings = settings
        self.safe = SafeState()
        self._log = logger(run=f"run{next(_numbers)}")
        self._machine = StateMachine(self._note_change)
        self._requests: queue.SimpleQueue[Request] = queue.SimpleQueue()
        self._supervisor = Supervisor(bench, interlocks(settings))

    @property
    def state(self) -> State:
        """Get the present state."""
        return self._machine.state

    @property
    def cause(self) -> str:
        """Get what led to ``fault``; empty in all other states."""
        return self._machine.cause

    def request(self, what: Request) -> None:
        """Ask for a way to stop, pause or go on; returns at once, safe from any thread or signal handler.

        ``finish`` ends after the line in hand, ``pause`` likewise but can go on, ``abort`` ends at the next place and
        drops the line in hand, ``interrupt`` is an abort by Ctrl-C or SIGTERM, ``emergency off`` ends at once and
        latches ``fault``.
        """
        self._requests.put(what)

    def connect(self) -> dict[str, Identity]:
        """Open every device, bring it to its safe state and say who answered.

        Raises
        ------
        DeviceError
            Of the device that failed; those that were opened are closed again, the state is ``fault``.
        """
        self._machine.go("connect", self._open_all)
        return self.bench.identify()

    def warm_up(self, watch: Callable[[TemperatureStatus], None] | None = None) -> None:
        """Bring the diode to its temperature and wait until it is stable; no light.

        Parameters
        ----------
        watch : callable, optional
            Called with each reading, once a second.

        Raises
        ------
        InterlockTripped
            When it does not become stable within ``diode.warm_up_limit_s``.
        Interrupted
            When an abort was asked for; the state is ``connected`` again and the diode is off.
        """
        self._machine.go("warm_up", lambda: self._warm(watch))
        if self.state == "warming":
            self._machine.go("warmed")
        else:
            raise Interrupted("stopped during warm-up; the laser was never on, the diode's controller is off")

    def scan(self, job: ScanJob, store: LineStore, sinks: Iterable[Sink] = ()) -> ScanOutcome:
        """Take the job's lines, store each before it is handed on, and leave the laser verified off.

        Parameters
        ----------
        job : ScanJob
            Raster and way of measuring.
        store : LineStore
            Makes each line durable.
        sinks : iterable of callables
            Get each line after it was stored. One that raises is left out from then on; the scan goes on.

        Raises
        ------
        InterlockTripped, DeviceError, RecordingError
            After the safe way out; the state is ``fault`` with the cause.
        NotAllowed
            In a state other than ``ready``.
        """
        self._machine.check("start_scan")
        self._supervisor.look_at_all(emitting=False)
        self.bench.sampler.configure(job.sweep)
        outcome = ScanOutcome()
        listeners = list(sinks)
        began_s = self.bench.clock.now()
        try:
            self._machine.go("start_scan", self._light_on)
            store.event(began_s, "laser on")
            for row in job.rows:
                self._obey(at_line=True, store=store)
                self._supervisor.look_at_all(emitting=True)
                line = job.take_line(row, self.bench.galvo, self.bench.sampler, self._between_places)
                self._check_reference(line)
                store.append(line, acknowledged_at_s=self.bench.clock.now())
                outcome.count(line)
                self._hand_on(line, listeners)
        except _EndScan as end:
            outcome.stop_reason = str(end)
        except BaseException as error:
            outcome.stop_reason = f"{type(error).__name__}: {error}"
            self._leave_light(outcome, began_s)
            if self.state != "fault":
                self._machine.fail(str(error))
            self._close_store(store, outcome)
            raise
        self._leave_light(outcome, began_s)
        self._machine.go("end_scan")
        self._write_end(store, outcome)
        return outcome

    def acknowledge(self) -> str:
        """Take note of a fault: close all links and start again from ``off``; returns the cause."""
        cause = self.cause
        self._machine.go("acknowledge", self._close_all)
        self._machine.clear()
        return cause

    def shut_down(self) -> SafeState:
        """Bring everything to its safe state, switch the diode's controller off, close all links."""
        self._machine.check("shut_down")
        self.safe = make_safe(self.bench)
        self._machine.go("shut_down", self._close_all)
        return self.safe

    # ---- entry actions

    def _open_all(self) -> None:
        try:
            for device in self.bench.devices().values():
                device.open()
            self.bench.pulser.configure(prf_hz=self.settings.pulser.prf_hz, drive_v=self.settings.pulser.drive_v)
        except BaseException:
            self._close_all()
            raise

    def _close_all(self) -> None:
        for name, device in self.bench.devices().items():
            try:
                device.close()
            except DeviceError as error:
                self._log.warning("close failed", device=name, error=str(error))

    def _warm(self, watch: Callable[[TemperatureStatus], None] | None) -> None:
        diode, limit_s = self.bench.diode, self.settings.diode.warm_up_limit_s
        diode.regulate(self.settings.diode.target_degc)
        end = self.bench.clock.now() + limit_s
        while True:
            status = diode.status()
            if watch is not None:
                watch(status)
            if status.problem:
                raise InterlockTripped("diode regulation", f"{status.problem} during warm-up; reset the controller")
            if status.stable:
                return
            if self.bench.clock.now() > end:
                raise InterlockTripped(
                    "warm-up",
                    f"{status.temperature_degc:.2f} degC after {limit_s:g} s, not stable; check the heat sink",
                )
            if self._stop_asked():
                diode.off()
                self._machine.go("cancel_warm_up")
                return
            self.bench.clock.sleep(WARM_POLL_S)

    def _light_on(self) -> None:
        self._supervisor.start_beating()
        self.bench.pulser.on()
        self.bench.sampler.gate_on()

    # ---- during a scan

    def _between_places(self) -> None:
        self._obey(at_line=False, store=None)
        self._supervisor.look()

    def _obey(self, *, at_line: bool, store: LineStore | None) -> None:
        """Carry out what was asked for; what must wait for the end of a line is put back until then."""
        later: list[Request] = []
        while not self._requests.empty():
            asked = self._requests.get()
            if asked == "emergency off":
                raise InterlockTripped("emergency off", "asked for by the operator; acknowledge to go on")
            if asked in ("abort", "interrupt"):
                raise _EndScan("aborted" if asked == "abort" else "interrupted")
            if asked == "resume":
                continue
            if store is None or not at_line:
                later.append(asked)
            elif asked == "finish":
                raise _EndScan("finished early")
            else:
                self._rest(store)
        for asked in later:
            self._requests.put(asked)

    def _rest(self, store: LineStore) -> None:
        """Laser off between two lines until somebody asks to go on (or to end)."""
        self._supervisor.stop_beating()
        self._machine.go("pause")
        safe = make_safe(self.bench)
        store.event(self.bench.clock.now(), "paused", **safe.steps)
        if not safe.laser_off_verified:
            raise InterlockTripped("pause", str(safe))
        while True:
            self.bench.clock.wait(lambda: not self._requests.empty(), PAUSE_POLL_S)
            if self._requests.empty():
                continue
            asked = self._requests.get()
            if asked == "resume":
                break
            if asked != "pause":
                self._requests.put(asked)
                self._obey(at_line=True, store=store)
        self._machine.go("resume", self._light_on)
        store.event(self.bench.clock.now(), "resumed")

    def _check_reference(self, line: ScanLine) -> None:
        if line.flags.size and bool((line.flags & Flag.NO_REFERENCE).all()):
            raise InterlockTripped("reference pulse", "none in a whole line; check laser and reference fibre")

    def _hand_on(self, line: ScanLine, sinks: list[Sink]) -> None:
        for sink in list(sinks):
            try:
                sink(line)
            except Exception as error:  # noqa: BLE001 - a viewer may fail in any way; the beam and the recording go on
                sinks.remove(sink)
                self._log.error("sink failed and is left out", sink=repr(sink), line=line.index, error=repr(error))

    def _leave_light(self, outcome: ScanOutcome, began_s: float) -> None:
        self._supervisor.stop_beating()
        self.safe = outcome.safe = make_safe(self.bench)
        outcome.device_time_s = self.bench.clock.now() - began_s
        level = self._log.info if outcome.safe.laser_off_verified else self._log.critical
        level("scan ended", reason=outcome.stop_reason, safe=str(outcome.safe), lines=outcome.lines)

    def _close_store(self, store: LineStore, outcome: ScanOutcome) -> None:
        """Write down a failed scan as far as the store can; the failure that ended the scan is the one to raise."""
        try:
            self._write_end(store, outcome)
        except Exception as error:  # noqa: BLE001 - must not hide the failure that is being raised
            self._log.error("the end of the scan could not be recorded", error=repr(error))

    def _write_end(self, store: LineStore, outcome: ScanOutcome) -> None:
        store.event(self.bench.clock.now(), "safe state", state=self.state, **outcome.safe.steps)
        store.finish(
            outcome.stop_reason,
            laser_off_verified=outcome.safe.laser_off_verified,
            device_time_s=outcome.device_time_s,
            flags=dict(outcome.flags),
        )

    def _stop_asked(self) -> bool:
        asked = [self._requests.get() for _ in range(self._requests.qsize())]
        if "emergency off" in asked:
            raise InterlockTripped("emergency off", "asked for by the operator; acknowledge to go on")
        return bool({"abort", "interrupt", "finish"} & set(asked))

    def _note_change(self, old: State, new: State, verb: str) -> None:
        self._log = self._log.bind(state=new)
        self._log.info("state", old=old, verb=verb, time_s=round(self.bench.clock.now(), 3), cause=self.cause)
