"""The controller: verbs of the radar, one owner of all devices, and a safe shutdown from everywhere."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterable

from picoradar.drivers.interfaces import Identity, TemperatureStatus
from picoradar.instrument.bench import Bench
from picoradar.instrument.controller.connection import Connection
from picoradar.instrument.controller.context import RunContext
from picoradar.instrument.controller.exposure import refuse_above_class_1
from picoradar.instrument.controller.interlocks import interlocks
from picoradar.instrument.controller.job import LineStore, ScanJob, ScanOutcome, Sink
from picoradar.instrument.controller.machine import StateMachine
from picoradar.instrument.controller.requests import Request, Requests
from picoradar.instrument.controller.run import ScanRun
from picoradar.instrument.controller.safety import SafeShutdown, SafeState
from picoradar.instrument.controller.states import BUSY, State
from picoradar.instrument.controller.subscribers import Subscription
from picoradar.instrument.controller.supervision import Supervisor
from picoradar.instrument.controller.warming import reach_temperature
from picoradar.instrument.errors import InterlockTripped, Interrupted
from picoradar.instrument.events import logger
from picoradar.instrument.settings import Settings

REST_POLL_S = 0.1

_numbers = itertools.count(1)


class Controller:
    """Runs one bench.

    All verbs are called from one thread, which owns the devices; `request` and `emergency_off` from any. What `request`
    asks for, also in a signal handler, is carried out between two points.

    Parameters
    ----------
    bench : Bench
        The devices, not yet opened.
    settings : Settings
        Checked settings of the run.

    Raises
    ------
    InterlockTripped
        When the light of these settings may exceed class 1; nothing has been opened.
    """

    def __init__(self, bench: Bench, settings: Settings) -> None:
        self.bench = bench
        self.settings = settings
        self._shutdown = SafeShutdown(bench)
        self._owner = threading.get_ident()
        self._log = logger(run=f"run{next(_numbers)}")
        self._machine = StateMachine(self._note_change)
        self._requests = Requests()
        self._supervisor = Supervisor(bench, interlocks(settings, refuse_above_class_1(settings.pulser)))
        self._connection = Connection(bench, self._shutdown, self._log)

    @property
    def state(self) -> State:
        """Get the present state."""
        return self._machine.state

    @property
    def safe(self) -> SafeState:
        """Get the outcome of the last safe shutdown; without steps before the first."""
        return self._shutdown.last

    @property
    def cause(self) -> str:
        """Get what led to ``fault``; empty in all other states."""
        return self._machine.cause

    def why(self) -> list[str]:
        """Get what holds the run now: the latched cause of a fault, and each interlock that does not hold."""
        return [*filter(None, [self.cause]), *self._supervisor.monitor.why()]

    def request(self, what: Request) -> None:
        """Ask for a way to stop, pause or go on; returns at once, safe from any thread or signal handler.

        ``finish`` and ``registered`` (from a sink that knows enough) end after the line in hand; ``pause`` waits there,
        and can go on. ``abort`` ends at the next point and drops the line in hand, ``interrupt`` is an abort by a
        signal, ``emergency off`` ends at the next point, switches the diode off too and latches ``fault``.
        """
        self._requests.put(what)

    def connect(self) -> dict[str, Identity]:
        """Open every device, bring it to its safe state and say who answered.

        Raises
        ------
        DeviceError
            Of the device that failed; those that were opened are closed again, the state is ``fault``.
        """
        self._owner = threading.get_ident()
        self._machine.go("connect", lambda: self._connection.open(self.settings.pulser))
        return dict(self._connection.known)

    def work_at(self, settings: Settings) -> None:
        """Go by other settings of pulser and diode from the next `warm_up` and `scan` on; the laser is off.

        Raises
        ------
        InterlockTripped
            When their light may exceed class 1; nothing has changed.
        DeviceError
            When the pulser does not take them.
        NotAllowed
            In a state other than ``connected`` and ``ready``.
        """
        self._machine.check("warm_up")
        supervisor = Supervisor(self.bench, interlocks(settings, refuse_above_class_1(settings.pulser)))
        self.bench.pulser.configure(prf_hz=settings.pulser.prf_hz, drive_v=settings.pulser.drive_v)
        self.settings, self._supervisor = settings, supervisor

    def warm_up(self, show: Callable[[TemperatureStatus], None] | None = None) -> None:
        """Bring the diode to its temperature and wait until it is stable; no light.

        Parameters
        ----------
        show : callable, optional
            Called with each reading, once a second.

        Raises
        ------
        InterlockTripped
            When it does not become stable within ``diode.warm_up_limit_s``.
        Interrupted
            When an abort was asked for; the state is ``connected`` again and the diode is off.
        """
        self._machine.check("warm_up")
        self._owner = threading.get_ident()
        try:
            self._machine.go("warm_up", lambda: self._warm(show))
            if self.state == "warming":
                self._machine.go("warmed")
            self._requests.raise_emergency()  # from another thread, which until here could only ask
        except BaseException as error:
            self._shutdown(diode_off=True)
            self._machine.fail(str(error) or type(error).__name__)
            raise
        if self.state != "ready":
            raise Interrupted("stopped during warm-up; the laser was never on, the diode's controller is off")

    def scan(self, job: ScanJob, store: LineStore, sinks: Iterable[Sink | Subscription] = ()) -> ScanOutcome:
        """Take the job's lines, store each before it is handed on, and leave the laser verified off.

        Parameters
        ----------
        job : ScanJob
            Raster and way of measuring.
        store : LineStore
            Makes each line durable.
        sinks : iterable of callables or Subscription
            Get each line after it was stored; none holds the scan. On a real clock each has a thread, and a bare
            callable that is too slow misses lines (`Subscription` is for those that must see all). One that raises
            is left out. How far each came stands in the outcome.

        Raises
        ------
        InterlockTripped, DeviceError, RecordingError
            After the safe shutdown; the state is ``fault`` with the cause, or still ``ready`` when an interlock that
            may come back by itself held the scan before there was light.
        NotAllowed
            In a state other than ``ready``.
        """
        self._machine.check("start_scan")
        self._owner = threading.get_ident()
        self._supervisor.begin()
        owned = (self._machine, self._supervisor, self._requests, self._connection.known, self._shutdown, self._log)
        context = RunContext(self.bench, self.settings, *owned)
        return ScanRun(context, job, store, list(sinks)).run()

    def rest(self, until: Callable[[], bool] = lambda: True) -> None:
        """Let time pass without light until something holds; obeys at once who asks to stop.

        Parameters
        ----------
        until : callable
            Polled ten times a second; by default requests are polled once.

        Raises
        ------
        Interrupted
            When a way to stop was asked for, after the safe shutdown; the state is what it was.
        InterlockTripped
            After an emergency off; the state is ``fault``.
        """
        while True:
            try:
                stop = self._requests.stop_asked()
            except InterlockTripped:
                self.emergency_off()
                raise
            if stop:
                self._shutdown()
                raise Interrupted("interrupted")
            if until():
                return
            self.bench.clock.wait(lambda: until() or self._requests.waiting(), REST_POLL_S)

    def acknowledge(self) -> str:
        """Take note of a fault: close all links, each device in its safe state, and return the cause."""
        self._machine.check("acknowledge")
        cause = self.cause
        self._machine.go("acknowledge", self._connection.close)
        self._machine.clear()
        self._supervisor.monitor.clear()
        self._requests.clear()
        return cause

    def shut_down(self) -> SafeState:
        """Bring everything to its safe state, switch the diode's controller off, close all links; in every state.

        A fault stays latched until it is acknowledged. While the radar warms up or scans this is an emergency off,
        and the links stay open for the run that ends: call it again after that.
        """
        if self.state in BUSY:
            return self.emergency_off()
        if self._connection.is_open or self.state not in ("off", "fault"):
            self._shutdown(diode_off=True)
            self._machine.go("shut_down", self._connection.close)
        return self.safe

    def emergency_off(self) -> SafeState:
        """Everything off now, in every state and from any thread; latches ``fault``.

        While the radar warms up or scans, another thread than the one that does so only asks, and gets the outcome of
        the shutdown before.
        """
        if self.state in BUSY:
            self.request("emergency off")
            if self.state in BUSY and threading.get_ident() != self._owner:
                return self.safe
        self._supervisor.stop_beating()
        self._shutdown(diode_off=True)
        self._machine.fail(f"emergency off; {self.safe}")
        return self.safe

    def _warm(self, show: Callable[[TemperatureStatus], None] | None) -> None:
        if not reach_temperature(self.bench, self.settings.diode, self._requests, show):
            self._machine.go("cancel_warm_up")

    def _note_change(self, old: State, new: State, verb: str) -> None:
        self._log = self._log.bind(state=new)
        self._log.info("state", old=old, verb=verb, time_s=round(self.bench.clock.now(), 3), cause=self.cause)
