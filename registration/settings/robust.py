"""All settings of the robust method, and those of its schedule."""

from __future__ import annotations

from dataclasses import dataclass, field

from picoradar.registration.settings.edges import EdgeSettings
from picoradar.registration.settings.fit import BeamFitSettings, BrightnessSettings, WeakModeSettings
from picoradar.registration.settings.preparation import SphereSettings
from picoradar.registration.settings.scan import NoiseSettings, TissueSettings
from picoradar.registration.settings.search import SearchSettings, StepSettings
from picoradar.registration.settings.trust import TrustSettings


@dataclass(frozen=True)
class ScheduleSettings:
    """Which candidates of the search are worth a beam fit, and what is reported beside the best."""

    max_fits: int = 3
    """Candidates that are fitted at most, beside the one that most starts ended at."""

    fit_within_nats: float = 60.0
    """Candidates are fitted whose total log likelihood is within this of the best one's: fields flatter wrong poses."""

    max_rivals: int = 5
    """Rivals reported at most."""


@dataclass(frozen=True)
class RobustSettings:
    """Settings of :func:`picoradar.registration.register` with ``method="robust"``.

    Those that a model is prepared with are a :class:`PreparationSettings`, given to
    :func:`picoradar.registration.prepare_model`.
    """

    noise: NoiseSettings = field(default_factory=NoiseSettings)
    tissue: TissueSettings = field(default_factory=TissueSettings)
    sphere: SphereSettings = field(default_factory=SphereSettings)
    step: StepSettings = field(default_factory=StepSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    schedule: ScheduleSettings = field(default_factory=ScheduleSettings)
    beam_fit: BeamFitSettings = field(default_factory=BeamFitSettings)
    weak_mode: WeakModeSettings = field(default_factory=WeakModeSettings)
    edges: EdgeSettings = field(default_factory=EdgeSettings)
    brightness: BrightnessSettings = field(default_factory=BrightnessSettings)
    trust: TrustSettings = field(default_factory=TrustSettings)
