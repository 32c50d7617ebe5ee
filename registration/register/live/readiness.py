"""Whether a search for the pose is worth its time: cheap tests of the points alone."""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.settings import LiveSettings


def what_is_lacking(points: FloatArray, settings: LiveSettings) -> str:
    """Say what points (N, 3) mm lack to hold a pose; empty when a search is worth while."""
    if len(points) < settings.min_points:
        return f"{len(points)} points; a pose is looked for from {settings.min_points} on"
    local = points - points.mean(axis=0)
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(local.T @ local / len(points)), 0.0))
    if spread[1] < settings.min_width_mm:
        return f"the points lie within {spread[1]:.1f} mm (SD) of a line; {settings.min_width_mm:g} mm are needed"
    if spread[0] < settings.min_relief_mm:
        return f"the points lie within {spread[0]:.1f} mm (SD) of a plane; {settings.min_relief_mm:g} mm are needed"
    return ""
