"""Rigid registration of measured surface points to a model, and how far to trust it.

Knows nothing of lasers or drivers: it takes points with, optionally, where the beams came from, covariances,
amplitudes and raster neighbours. Millimetres and radians throughout; poses are 4x4, named ``fixed_from_moving``.
"""

from __future__ import annotations

from picoradar.registration.classic import DissertationSettings
from picoradar.registration.errors import DegenerateError, MeshError, PointsError, RegistrationError, StartError
from picoradar.registration.live import LiveRegistration
from picoradar.registration.model import Model, load_model, prepare_model
from picoradar.registration.paired_points import PairedPoints, judge_pairs, paired_points, second_order
from picoradar.registration.register import check_targets, register
from picoradar.registration.search import Cone, Landmarks
from picoradar.registration.settings import PreparationSettings, RobustSettings
from picoradar.registration.solution import Rival, pose_error, residual_measures
from picoradar.registration.trust import ErrorBudget, Objection, Registration, Target, Tolerance

__all__ = [
    "Cone",
    "DegenerateError",
    "DissertationSettings",
    "ErrorBudget",
    "Landmarks",
    "LiveRegistration",
    "MeshError",
    "Model",
    "Objection",
    "PairedPoints",
    "PointsError",
    "PreparationSettings",
    "Registration",
    "RegistrationError",
    "Rival",
    "RobustSettings",
    "StartError",
    "Target",
    "Tolerance",
    "check_targets",
    "judge_pairs",
    "load_model",
    "paired_points",
    "pose_error",
    "prepare_model",
    "register",
    "residual_measures",
    "second_order",
]
