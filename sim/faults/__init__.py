"""Faults of the simulated bench, declared as data and injected at the wire and in the physics."""

from __future__ import annotations

from typing import TYPE_CHECKING

from picoradar._lazy import lazy_names

if TYPE_CHECKING:
    from picoradar.sim.faults.fault import At, Fault
    from picoradar.sim.faults.injector import arm
    from picoradar.sim.faults.kinds import KINDS
    from picoradar.sim.faults.scenario import load_scenario

__all__ = ["KINDS", "At", "Fault", "arm", "load_scenario"]

_HOMES = {"At": "fault", "Fault": "fault", "arm": "injector", "KINDS": "kinds", "load_scenario": "scenario"}


# The kinds need the whole bench, which takes a moment to load: each name is imported on first use.
__getattr__, __dir__ = lazy_names(__name__, _HOMES)
