"""Bench procedures: calibrate the radar and test its accuracy, each with a report that a person reads at a glance."""

from __future__ import annotations

from collections.abc import Callable

from picoradar.instrument.procedures import distance, drift, transmitter, zero
from picoradar.instrument.procedures.geometry import procedure as geometry
from picoradar.instrument.procedures.gray_target import procedure as gray_target
from picoradar.instrument.procedures.gray_target import templates
from picoradar.instrument.procedures.penetration import procedure as penetration
from picoradar.instrument.procedures.prism import procedure as prism
from picoradar.instrument.procedures.scanner import procedure as scanner
from picoradar.instrument.procedures.station.outcome import Outcome
from picoradar.instrument.procedures.station.station import Station

PROCEDURES: dict[str, Callable[[Station], Outcome]] = {
    gray_target.NAME: gray_target.run,
    geometry.NAME: geometry.run,
    prism.NAME: prism.run,
    distance.NAME: distance.run,
    scanner.NAME: scanner.run,
    templates.NAME: templates.run,
    drift.NAME: drift.run,
    transmitter.NAME: transmitter.run,
    penetration.NAME: penetration.run,
    zero.NAME: zero.run,
}

__all__ = ["PROCEDURES", "Outcome", "Station"]
