"""The simulated bench: physics, device firmware, virtual ports, faults.

`SimulatedBench` is imported on first use, because the physics takes a moment to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from picoradar._lazy import lazy_names

if TYPE_CHECKING:
    from picoradar.sim.bench import SimulatedBench

__all__ = ["SimulatedBench"]


__getattr__, __dir__ = lazy_names(__name__, {"SimulatedBench": "bench"})
