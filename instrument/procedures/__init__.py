"""Bench procedures: calibrate the radar and test its accuracy, each with a report that a person reads at a glance."""

from __future__ import annotations

from collections.abc import Callable

from instrument.procedures import distance, drift, geometry, gray_target, prism, scanner, templates, transmitter
from instrument.procedures.outcome import Outcome
from instrument.procedures.station import Station

PROCEDURES: dict[str, Callable[[Station], Outcome]] = {
    gray_target.NAME: gray_target.run,
    geometry.NAME: geometry.run,
    prism.NAME: prism.run,
    distance.NAME: distance.run,
    scanner.NAME: scanner.run,
    templates.NAME: templates.run,
    drift.NAME: drift.run,
    transmitter.NAME: transmitter.run,
}

__all__ = ["PROCEDURES", "Outcome", "Station"]
