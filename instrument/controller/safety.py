"""The safe way out: every barrier before the laser is closed and read back, whatever failed before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.errors import DeviceError
from instrument.bench import Bench

VERIFIED = "verified"


@dataclass(frozen=True)
class SafeState:
    """Outcome of one way out.

    Attributes
    ----------
    steps : dict
        For each step ``"verified"`` (read back from the device) or what went wrong.
    """

    steps: dict[str, str] = field(default_factory=dict)

    @property
    def laser_off_verified(self) -> bool:
        """Get whether the light is proven off: gate or triggers-and-supply, either of which suffices, read back."""
        return VERIFIED in (self.steps.get("gate"), self.steps.get("pulser"))

    @property
    def complete(self) -> bool:
        """Get whether every single step was verified."""
        return all(outcome == VERIFIED for outcome in self.steps.values())

    def __str__(self) -> str:
        laser = "laser off verified" if self.laser_off_verified else "LASER NOT VERIFIED OFF: open the interlock"
        open_points = [f"{name}: {outcome}" for name, outcome in self.steps.items() if outcome != VERIFIED]
        return "; ".join([laser, *open_points])


def make_safe(bench: Bench) -> SafeState:
    """Close the gate, stop triggers and supply, end the run, park the mirrors; each tried, each read back.

    Never raises a `DeviceError`: a step that fails is written down and the next one is tried.
    """
    steps: dict[str, Callable[[], None]] = {
        "gate": bench.sampler.gate_off,
        "pulser": bench.pulser.off,
        "run": bench.sampler.stop,
        "mirrors": bench.galvo.park,
    }
    return SafeState({name: _attempt(step) for name, step in steps.items()})


def _attempt(step: Callable[[], None]) -> str:
    try:
        step()
    except DeviceError as error:
        return str(error)
    return VERIFIED
