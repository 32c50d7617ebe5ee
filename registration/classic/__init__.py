"""Methods of the literature: the dissertation's, ICP and its acceleration, robust criteria, baselines."""

from picoradar.registration.classic.baselines import head_and_hat, lm_icp, plane_icp
from picoradar.registration.classic.dissertation import (
    DissertationResult,
    DissertationSettings,
    register_dissertation,
    solve_as_dissertation,
)
from picoradar.registration.classic.losses import LOSSES

__all__ = [
    "LOSSES",
    "DissertationResult",
    "DissertationSettings",
    "head_and_hat",
    "lm_icp",
    "plane_icp",
    "register_dissertation",
    "solve_as_dissertation",
]
