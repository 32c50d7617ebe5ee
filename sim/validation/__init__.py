"""The simulator against the dissertation: each stated value beside what the simulator gives."""

from __future__ import annotations

from picoradar.sim.validation.figures import Check
from picoradar.sim.validation.run import validate

__all__ = ["Check", "validate"]
