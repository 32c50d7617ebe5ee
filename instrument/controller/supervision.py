"""What watches over a run: the heartbeat of the gate, and a regular look at all interlocks."""

from __future__ import annotations

from drivers.clock import Timer
from drivers.errors import DeviceError
from instrument.bench import Bench
from instrument.controller.interlocks import Interlock, Readings, check_all

WATCHDOG_S = 1.0  # time limit that the sampler's driver sets in the device
BEAT_S = WATCHDOG_S / 4  # SBP 1.0 section 5: every quarter of the timeout
LOOK_S = 1.0  # between two places, diode and gate are looked at this often


class Supervisor:
    """Feeds the watchdog as long as all is well, and looks at the interlocks.

    The heartbeat is a timer of the clock and runs in the one thread that also looks at the interlocks: when that
    thread is stuck, or has seen a fault, the beat stops and the bridge closes the gate by itself.
    """

    def __init__(self, bench: Bench, table: tuple[Interlock, ...]) -> None:
        self._bench = bench
        self._table = table
        self._timer: Timer | None = None
        self._failure: DeviceError | None = None
        self._last_look_s = -float("inf")

    def start_beating(self) -> None:
        """Send the first heartbeat now and one each quarter of the watchdog's time from then on."""
        self._failure = None
        self._bench.sampler.heartbeat()
        self._timer = self._bench.clock.every(BEAT_S, self._beat)

    def stop_beating(self) -> None:
        """Stop; the gate closes by itself when the watchdog expires."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def look_at_all(self, *, emitting: bool) -> None:
        """Ask every device and check every interlock.

        Raises
        ------
        InterlockTripped, DeviceError
        """
        readings = Readings(self._bench.pulser.status(), self._bench.diode.status(), self._bench.sampler.status())
        self._check(readings, emitting=emitting)

    def look(self) -> None:
        """Between two places: check the heartbeat always, and diode and gate once a second.

        Raises
        ------
        InterlockTripped, DeviceError
        """
        self._raise_failure()
        if self._bench.clock.now() - self._last_look_s >= LOOK_S:
            self._check(Readings(None, self._bench.diode.status(), self._bench.sampler.status()), emitting=True)

    def _check(self, readings: Readings, *, emitting: bool) -> None:
        self._raise_failure()
        self._last_look_s = self._bench.clock.now()
        check_all(self._table, readings, emitting=emitting)

    def _beat(self) -> None:
        try:
            self._bench.sampler.heartbeat()
        except DeviceError as error:
            self._failure = error  # raised by the next look, in the run itself
            self.stop_beating()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure
