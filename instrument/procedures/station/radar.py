"""`Radar`: the warm radar that procedures measure with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from picoradar.drivers.clock import Clock
from picoradar.drivers.interfaces import Identity
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.controller import Controller
from picoradar.instrument.settings import Settings


@dataclass(frozen=True)
class Radar:
    """A radar that is connected and warm.

    Attributes
    ----------
    controller : Controller
        In state ``ready``.
    settings : Settings
    calibration : Calibration
        In force while measuring.
    identities : mapping
        What answered, for the recordings' headers.
    seed : int or None
        Of the simulated bench, for the recordings' headers.
    """

    controller: Controller
    settings: Settings
    calibration: Calibration
    identities: Mapping[str, Identity]
    seed: int | None = None

    @property
    def clock(self) -> Clock:
        """Get the bench's clock."""
        return self.controller.bench.clock
