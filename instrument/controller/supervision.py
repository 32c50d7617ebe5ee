"""`Supervisor`: the heartbeat of the gate, and a regular poll of all interlocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from picoradar.drivers.clock import Timer
from picoradar.drivers.errors import DeviceError
from picoradar.instrument.bench import Bench
from picoradar.instrument.controller.interlock_monitor import InterlockMonitor
from picoradar.instrument.controller.interlocks import Interlock, Readings
from picoradar.instrument.errors import InterlockTripped
from picoradar.instrument.settings import WATCHDOG

BEAT_S = WATCHDOG.value / 4  # SBP 1.0 section 5: every quarter of the timeout
DIODE_POLL_S = 2.0  # between two points, the diode is polled this often; it cannot leave its band faster
# All readings of the slow serial links are taken between two lines, this often. What can change faster shows elsewhere
# before each point or line: gate, trigger rate, interlock at the bridge; drive voltage in the reference's amplitude.
POLL_ALL_S = 5.0
# The second barrier, behind those links, is asked whether it is there, without waiting for an answer: a lost cable
# shows after this, a beat and the time of an answer, within one second of the clock.
WATCH_S = 0.24  # a little under the period of the heartbeat: one question a beat


class Supervisor:
    """Feeds the watchdog as long as all is well, and polls the interlocks.

    The heartbeat is a timer of the clock and runs in the one thread that also polls the interlocks: when that
    thread is stuck, or has seen a fault, the beat stops and the bridge closes the gate by itself.
    Every poll hands each device's readings to the monitor before it asks the next device, the fastest link first.
    """

    def __init__(self, bench: Bench, table: tuple[Interlock, ...]) -> None:
        self.monitor = InterlockMonitor(table, bench.clock)
        self._bench = bench
        self._timer: Timer | None = None
        self._failure: DeviceError | None = None
        self._pulser_free = False
        self._watched_s = -float("inf")
        self._diode_seen_s = -float("inf")
        self._all_seen_s = -float("inf")
        self._first_reference_mv: float | None = None
        self._resumed: dict[str, float | None] = {}

    def begin(self) -> None:
        """Forget what an earlier run has left."""
        self.monitor.clear()
        self._first_reference_mv = None

    def state_dict(self) -> dict[str, float | None]:
        """Get how long ago (s) which readings were taken, and the first reference (mV), to go on with later."""
        now_s = self._bench.clock.now()
        return {
            "all_age_s": now_s - self._all_seen_s,
            "diode_age_s": now_s - self._diode_seen_s,
            "first_reference_mv": self._first_reference_mv,
        }

    def load_state(self, state: Mapping[str, float | None]) -> None:
        """Go on from a `state_dict`: from the next line on, polls are due when they would have been."""
        if isinstance(state, Mapping):  # a recording may hold anything there
            self._resumed = dict(state)

    def _go_on(self) -> None:
        if not self._resumed:
            return
        now_s = self._bench.clock.now()
        # A recording may be damaged, of an earlier version, or made to put the polls off: what is no age is left out.
        numbers = {n: value for n, value in self._resumed.items() if isinstance(value, (int, float)) and value >= 0.0}
        self._all_seen_s = now_s - numbers.get("all_age_s", now_s - self._all_seen_s)
        self._diode_seen_s = now_s - numbers.get("diode_age_s", now_s - self._diode_seen_s)
        self._first_reference_mv = numbers.get("first_reference_mv", self._first_reference_mv)
        self._resumed = {}

    def start_beating(self) -> None:
        """Send the first heartbeat now and one each quarter of the watchdog's time from then on."""
        self.stop_beating()
        self._failure = None
        self._bench.sampler.heartbeat()
        self._timer = self._bench.clock.every(BEAT_S, self._beat)

    def stop_beating(self) -> None:
        """Stop; the gate closes by itself when the watchdog expires."""
        self._pulser_free = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def rest(self) -> None:
        """Stop beating, and forget what the beat has met: it has been acted upon, there is no light any more."""
        self.stop_beating()
        self._failure = None

    def poll_all(self, *, emitting: bool, disk_lines: Callable[[], float] | None = None) -> None:
        """Ask every device and check every interlock.

        Parameters
        ----------
        emitting : bool
            Whether the laser is on.
        disk_lines : callable, optional
            Gets the number of lines for which the disk has room.

        Raises
        ------
        InterlockTripped, DeviceError
        """
        bench = self._bench
        self._judge(Readings(sampler=bench.sampler.status()), emitting=emitting)
        self._pulser_free = False
        pulser = bench.pulser.status()
        self._pulser_free = emitting
        self._judge(Readings(pulser=pulser), emitting=emitting)
        self._judge(Readings(diode=bench.diode.status()), emitting=emitting)
        self._diode_seen_s = bench.clock.now()
        bench.galvo.ready()  # busy or not does not matter: it has answered
        lines = disk_lines() if disk_lines is not None else None
        self._judge(Readings(mirrors_answer=True, disk_lines=lines), emitting=emitting)
        self._all_seen_s = bench.clock.now()

    def poll_before_line(self, disk_lines: Callable[[], float]) -> None:
        """Between two lines, with the laser on: poll all devices if it is due again, else as before a point.

        Raises
        ------
        InterlockTripped, DeviceError
        """
        self._go_on()
        if self._bench.clock.now() - self._all_seen_s >= POLL_ALL_S:
            self.poll_all(emitting=True, disk_lines=disk_lines)
        else:
            self.poll()

    def poll(self) -> None:
        """Before each point: heartbeat and bridge; the diode every two seconds.

        A beat here keeps the timer's beats inside the records, where they delay nothing: the time between the
        mirrors' step and the first shot is then the same at every point, whatever happened before.

        Raises
        ------
        InterlockTripped, DeviceError
        """
        self._raise_failure()
        self._rearm()
        self._judge(Readings(sampler=self._bench.sampler.status()), emitting=True)
        if self._bench.clock.now() - self._diode_seen_s >= DIODE_POLL_S:
            self._judge(Readings(diode=self._bench.diode.status()), emitting=True)
            self._diode_seen_s = self._bench.clock.now()

    def judge_line(self, reference_mv: float, reference_ps: float | None) -> None:
        """After each line, before it counts: the gate is still open, the reference was there, and as in the first line.

        Parameters
        ----------
        reference_mv : float
            Its lowest amplitude in the line; 0 when most points had none.
        reference_ps : float or None
            Its instant on the trace.

        Raises
        ------
        InterlockTripped, DeviceError
        """
        sampler = self._bench.sampler.status()
        share = reference_mv / self._first_reference_mv if self._first_reference_mv else None
        self._judge(Readings(None, None, sampler, None, reference_mv, share, reference_ps), emitting=True)
        self._first_reference_mv = self._first_reference_mv or reference_mv

    def _judge(self, readings: Readings, *, emitting: bool) -> None:
        self._raise_failure()
        self.monitor.judge(readings, emitting=emitting)

    def _rearm(self) -> None:
        """Beat now, and count the quarters of the watchdog's time from here."""
        if self._timer is not None:
            self._timer.cancel()
            self._bench.sampler.heartbeat()
            self._watch_pulser()
            self._raise_failure()
            self._timer = self._bench.clock.every(BEAT_S, self._beat)

    def _beat(self) -> None:
        """Beat; when the bridge does not take it, end the light by the other barrier at once.

        The run itself learns of it at its next poll, perhaps a record later. The triggers are stopped from here only
        while nobody else is in the middle of a question to the pulser.
        """
        try:
            self._bench.sampler.heartbeat()
        except DeviceError as error:
            self._failure = error
            pulser_free = self._pulser_free
            self.stop_beating()
            if pulser_free:
                self._stop_triggers(error)
        else:
            self._watch_pulser()

    def _watch_pulser(self) -> None:
        """Look whether the second barrier still answers; when it does not, close the first one at once.

        Only while nobody else is in the middle of a question to the pulser.
        """
        now_s = self._bench.clock.now()
        if not self._pulser_free or now_s - self._watched_s < WATCH_S:
            return
        try:
            if self._bench.pulser.watch() is not None:
                self._watched_s = now_s
        except DeviceError as error:
            self._failure = error
            self.stop_beating()
            self._close_gate(error)

    def _close_gate(self, because: DeviceError) -> None:
        try:
            self._bench.sampler.gate_off()
        except DeviceError as error:  # its watchdog closes it; the safe shutdown tries it again
            because.add_note(f"and the gate could not be closed: {error}")

    def _stop_triggers(self, because: DeviceError) -> None:
        try:
            self._bench.pulser.off()
        except DeviceError as error:  # the safe shutdown tries it again, and writes down what came of it
            because.add_note(f"and the pulser could not be switched off: {error}")

    def first_failure(self, error: Exception) -> Exception:
        """Get what the heartbeat has met, which is what led to ``error``; that one itself when it has met nothing.

        An interlock that switches everything off, or an emergency off, stands above both.
        """
        grave = isinstance(error, InterlockTripped) and error.action == "off"
        return error if grave or self._failure is None else self._failure

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure
