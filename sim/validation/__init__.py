"""The simulator against the dissertation: each stated value beside what the simulator gives."""

from __future__ import annotations

from picoradar.sim.validation.bench import SAMPLES, SWEEPS, TIMES_PS, Bench, painted
from picoradar.sim.validation.distance import overlap_cm
from picoradar.sim.validation.figures import Check
from picoradar.sim.validation.run import PARTS, SEED, validate

__all__ = [
    "PARTS",
    "SAMPLES",
    "SEED",
    "SWEEPS",
    "TIMES_PS",
    "Bench",
    "Check",
    "overlap_cm",
    "painted",
    "validate",
]
