"""Rigid registration of measured surface points to a model, and how far to trust it.

Knows nothing of lasers or drivers: it takes points with, optionally, where the beams came from, covariances,
amplitudes and raster neighbours. Millimetres and radians throughout; poses are 4x4, named ``fixed_from_moving``.
"""

from __future__ import annotations

from registration.cone import Cone
from registration.dissertation import DissertationSettings
from registration.errors import DegenerateError, MeshError, PointsError, RegistrationError, StartError
from registration.files import load_model
from registration.front import check_targets, register
from registration.measures import pose_error, residual_measures
from registration.model import Model, prepare_model
from registration.paired import PairedPoints, paired_points
from registration.quality import Target
from registration.result import Registration, Rival
from registration.start import Landmarks
from registration.verdict import Tolerance

__all__ = [
    "Cone",
    "DegenerateError",
    "DissertationSettings",
    "Landmarks",
    "MeshError",
    "Model",
    "PairedPoints",
    "PointsError",
    "Registration",
    "RegistrationError",
    "Rival",
    "StartError",
    "Target",
    "Tolerance",
    "check_targets",
    "load_model",
    "paired_points",
    "pose_error",
    "prepare_model",
    "register",
    "residual_measures",
]
