"""The parameters of the plane-constrained calibration in words."""

from __future__ import annotations

import math

import numpy as np

from picoradar.instrument.procedures.geometry.plane_fit import PlaneFit
from picoradar.instrument.procedures.geometry.planes import PARAMETERS


def in_words(fit: PlaneFit) -> list[str]:
    """Say each parameter with its uncertainty, or that these poses do not identify it."""
    return [
        _sentence(name, value, sd) if identified else f"{named(name)}: these poses do not identify it"
        for name, value, sd, identified in zip(PARAMETERS, fit.values, fit.sd, fit.identified, strict=True)
    ]


def named(parameter: str) -> str:
    """Return a parameter's name in words."""
    return _WORDS[parameter][0]


def _sentence(name: str, value: float, sd: float) -> str:
    words, unit, factor = _WORDS[name]
    digits = max(0, 1 - math.floor(math.log10(factor * sd)))
    return f"{words}: {factor * value:.{digits}f} ± {factor * sd:.{digits}f}{unit}"


_DEG = 180 / np.pi
_WORDS = {
    "mirror_separation_mm": ("mirror separation", " mm", 1.0),
    "x_scale": ("scale error of the first mirror", " %", 100.0),
    "y_scale": ("scale error of the second mirror", " %", 100.0),
    "x_offset_rad": ("offset of the first mirror", " deg", _DEG),
    "y_offset_rad": ("offset of the second mirror", " deg", _DEG),
    "non_orthogonality_rad": ("non-orthogonality", " deg", _DEG),
    "range_zero_mm": ("range zero", " mm", 1.0),
}
