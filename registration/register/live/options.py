"""`RegisterOptions`: what a live registration is asked, in the words of `register`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict

import numpy.typing as npt

from picoradar.registration.register.asked import budget_with, with_model_noise
from picoradar.registration.search import Start
from picoradar.registration.settings import RobustSettings
from picoradar.registration.trust import ErrorBudget, Objection, Tolerance


class RegisterOptions(TypedDict, total=False):
    """Keyword arguments of :func:`registration.register` that a live registration takes, too."""

    start: Start
    origin: npt.ArrayLike
    targets: npt.ArrayLike | Sequence[dict[str, object]] | None
    noise_mm: float | None
    range_bias_mm: float | None
    sigma_model_mm: float | None
    model_offset_mm: float | None
    budget: ErrorBudget | None
    exclude: Sequence[Mapping[str, object]] | None
    tolerance: Tolerance | None
    objections: Sequence[Objection]
    settings: RobustSettings


def budget_of(options: RegisterOptions) -> ErrorBudget:
    """Error budget of the options, with what is given on its own.

    Raises
    ------
    RegistrationError
        If one is no standard deviation in mm.
    """
    return budget_with(
        options.get("budget"),
        options.get("range_bias_mm"),
        options.get("sigma_model_mm"),
        options.get("model_offset_mm"),
    )


def settings_of(options: RegisterOptions, usual: RobustSettings) -> RobustSettings:
    """Settings of the options, or the usual ones, with the model's error of the budget in the noise."""
    return with_model_noise(options.get("settings", usual), budget_of(options))
