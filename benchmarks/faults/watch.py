"""Watching a run from outside: when there was light, and when the host began to switch it off."""

from __future__ import annotations

from typing import Any

from picoradar.drivers.bridge.sbp import Gate
from picoradar.sim import SimulatedBench

POLL_LIT_S, POLL_DARK_S = 1e-3, 0.02
LEAST_V = 200.0  # no shot below


class LightMeter:
    """Looks at the bench itself, every millisecond while there is light.

    Attributes
    ----------
    times : list of (float, float)
        When light began and ended.
    """

    def __init__(self, bench: SimulatedBench) -> None:
        self._bench = bench
        self._since_s: float | None = None
        self.times: list[tuple[float, float]] = []
        self._look()

    def is_lit(self) -> bool:
        """Get whether triggers reach a pulser that has voltage."""
        bench = self._bench
        open_gate = bench.bridge.gate.state is Gate.ON
        return open_gate and bench.trigger.rate_hz > 0 and bench.genesys.output_v() > LEAST_V

    def _look(self) -> None:
        lit, now_s = self.is_lit(), self._bench.clock.now()
        if lit and self._since_s is None:
            self._since_s = now_s
        elif not lit and self._since_s is not None:
            self.times.append((self._since_s, now_s))
            self._since_s = None
        self._bench.clock.call_at(now_s + (POLL_LIT_S if lit else POLL_DARK_S), self._look)


class Seen:
    """Stands before a device and notes when its driver first raised an error, and when light was first switched off.

    Attributes
    ----------
    errors : list of (float, str)
        Clock time and kind of each error that a call of the driver raised.
    off_s : list of float
        When ``gate_off`` or ``off`` was called.
    """

    def __init__(self, device: Any, clock: Any, errors: list[tuple[float, str]], off_s: list[float]) -> None:
        self._device = device
        self._clock = clock
        self._errors = errors
        self._off_s = off_s

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._device, name)
        if not callable(found):
            return found

        def call(*arguments: Any, **named: Any) -> Any:
            if name in ("gate_off", "off"):
                self._off_s.append(self._clock.now())
            try:
                return found(*arguments, **named)
            except Exception as error:
                self._errors.append((self._clock.now(), type(error).__name__))
                raise

        return call
