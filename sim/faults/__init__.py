"""Faults of the simulated bench, declared as data and injected at the wire and in the physics."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from picoradar.sim.faults.fault import At, Fault
    from picoradar.sim.faults.injector import arm
    from picoradar.sim.faults.kinds import KINDS
    from picoradar.sim.faults.scenario import load_scenario

__all__ = ["KINDS", "At", "Fault", "arm", "load_scenario"]

_HOMES = {"At": "fault", "Fault": "fault", "arm": "injector", "KINDS": "kinds", "load_scenario": "scenario"}


def __getattr__(name: str) -> object:
    # The kinds need the whole bench, which takes a moment to load: each name is imported when it is first used.
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(f"picoradar.sim.faults.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'picoradar.sim.faults' has no attribute {name!r}")
