"""The bench that is not there: physics, device firmware, virtual ports, faults.

`SimulatedBench` is imported when it is asked for, because the physics takes a moment to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from picoradar.sim.bench import SimulatedBench

__all__ = ["SimulatedBench"]


def __getattr__(name: str) -> Any:
    if name == "SimulatedBench":
        from picoradar.sim.bench import SimulatedBench

        return SimulatedBench
    raise AttributeError(f"module 'sim' has no attribute {name!r}")
