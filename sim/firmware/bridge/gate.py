"""Trigger gate and watchdog of the sampling bridge.

Source: protocol sheet ``sampling_bridge.md``, section 5. Nothing here opens the gate unless the host asks for it.
"""

from __future__ import annotations

from collections.abc import Callable

from picoradar.drivers.bridge.sbp import LASER_KEY, Caps, ErrorCode, Gate
from picoradar.drivers.clock import Clock, Timer
from picoradar.sim.firmware.bridge.checks import Refused
from picoradar.sim.wires import InterlockChain

POWER_UP_WATCHDOG_MS = 1000


class TriggerGate:
    """Passes the laser trigger on, or blocks it.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    interlock : InterlockChain
        Its opening closes the gate at once and locks it.
    caps : Caps
        Limits of the watchdog.
    changed : callable
        Called after each change of the state.
    tripped : callable
        Called when the watchdog has closed the gate.
    """

    def __init__(
        self,
        clock: Clock,
        interlock: InterlockChain,
        caps: Caps,
        changed: Callable[[], None],
        tripped: Callable[[], None],
    ) -> None:
        self.clock = clock
        self.interlock = interlock
        self.caps = caps
        self.state = Gate.OFF
        self.changed_at = 0.0
        self.watchdog_tripped = False
        self._changed = changed
        self._tripped = tripped
        self._timeout_s = POWER_UP_WATCHDOG_MS / 1000
        self._fed_at: float | None = None
        self._counter: int | None = None
        self._timer: Timer | None = None
        interlock.on_change(self._interlock_changed)

    @property
    def left_s(self) -> float:
        """Get the time left of the watchdog (s); 0 when it has expired or was never fed."""
        if self._fed_at is None:
            return 0.0
        return max(0.0, self._fed_at + self._timeout_s - self.clock.now())

    def laser(self, verb: int, key: bytes, *, configured: bool) -> None:
        """Carry out LASER: 0 off, 1 on, 2 clear the lock-out.

        Parameters
        ----------
        verb : int
        key : bytes
            The data stage: `LASER_KEY`, or empty for 0.
        configured : bool
            Whether the device has a configuration; without one the gate stays closed.

        Raises
        ------
        Refused
        """
        if verb > 2:
            raise Refused(ErrorCode.BAD_VALUE, verb)
        if len(key) != (0 if verb == 0 else len(LASER_KEY)):
            raise Refused(ErrorCode.BAD_LENGTH, len(key))
        if verb == 0:
            self.close()
            return
        if key != LASER_KEY:
            raise Refused(ErrorCode.BAD_KEY, int.from_bytes(key, "little"))
        if not self.interlock.closed:
            raise Refused(ErrorCode.INTERLOCK_OPEN)
        if verb == 2:
            self.watchdog_tripped = False
            self._set(Gate.OFF)
            return
        if not configured:
            raise Refused(ErrorCode.NOT_CONFIGURED)
        if self.state is Gate.LOCKED:
            raise Refused(ErrorCode.LASER_LOCKED)
        if self.left_s <= 0:
            raise Refused(ErrorCode.NO_HEARTBEAT)
        self._set(Gate.ON)
        self._arm()

    def heartbeat(self, counter: int) -> None:
        """Feed the watchdog with a counter that differs from the last one.

        Raises
        ------
        Refused
        """
        if counter == self._counter:
            raise Refused(ErrorCode.STALE_HEARTBEAT, counter)
        self._counter = counter
        self._fed_at = self.clock.now()
        self._arm()

    def set_watchdog(self, timeout_ms: int) -> None:
        """Set the time limit of the watchdog.

        Raises
        ------
        Refused
            When it is out of range, which 0 is: the watchdog cannot be disabled.
        """
        if not self.caps.watchdog_min_ms <= timeout_ms <= self.caps.watchdog_max_ms:
            raise Refused(ErrorCode.BAD_VALUE, timeout_ms)
        self._timeout_s = timeout_ms / 1000
        self._arm()

    def close(self) -> None:
        """Close the gate; a lock-out stays."""
        if self.state is Gate.ON:
            self._set(Gate.OFF)

    def reset(self) -> None:
        """Return to the state after power-up, except for a lock-out, which only LASER 2 ends."""
        self.close()
        self._fed_at = self._counter = None
        self._timeout_s = POWER_UP_WATCHDOG_MS / 1000
        self._arm()

    def lock(self) -> None:
        """Close the gate and lock it."""
        self._set(Gate.LOCKED)

    def _set(self, state: Gate) -> None:
        if state is not self.state:
            self.state = state
            self.changed_at = self.clock.now()
            self._changed()

    def _arm(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self.state is Gate.ON and self._fed_at is not None:
            self._timer = self.clock.call_at(self._fed_at + self._timeout_s, self._expired)

    def _expired(self) -> None:
        self._timer = None
        if self.state is Gate.ON:
            self.watchdog_tripped = True
            self.lock()
            self._tripped()

    def _interlock_changed(self) -> None:
        if not self.interlock.closed:
            self.lock()
