"""Every threshold of the robust method, with its unit and its source, in frozen dataclasses that are handed through.

Where a value was not taken from a paper it was chosen on simulated scans. What moving it by a factor of two either way
does to poses, verdicts and CPU time is measured by ``benchmarks/registration/sensitivity.py``; the table stands in
``docs/registration.md``, section "Sensitivity". Equation numbers are those of that document.
"""

from picoradar.registration.settings.edges import EdgeSettings
from picoradar.registration.settings.fit import BeamFitSettings, BrightnessSettings, WeakModeSettings
from picoradar.registration.settings.live import LiveSettings
from picoradar.registration.settings.preparation import (
    HollowSettings,
    PreparationSettings,
    SphereSettings,
    ViewSettings,
)
from picoradar.registration.settings.robust import RobustSettings, ScheduleSettings
from picoradar.registration.settings.scan import NoiseSettings, TissueSettings
from picoradar.registration.settings.search import SearchSettings, Stage, StepSettings
from picoradar.registration.settings.trust import TrustSettings

__all__ = [
    "BeamFitSettings",
    "BrightnessSettings",
    "EdgeSettings",
    "HollowSettings",
    "LiveSettings",
    "NoiseSettings",
    "PreparationSettings",
    "RobustSettings",
    "ScheduleSettings",
    "SearchSettings",
    "SphereSettings",
    "Stage",
    "StepSettings",
    "TissueSettings",
    "TrustSettings",
    "ViewSettings",
    "WeakModeSettings",
]
