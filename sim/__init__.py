"""The simulated bench: physics, device firmware, virtual ports, faults.

`SimulatedBench` is imported on first use, because the physics takes a moment to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from picoradar.sim.bench import SimulatedBench

__all__ = ["SimulatedBench"]


def __getattr__(name: str) -> object:
    if name == "SimulatedBench":
        from picoradar.sim.bench import SimulatedBench

        return SimulatedBench
    raise AttributeError(f"module 'picoradar.sim' has no attribute {name!r}")
