"""What a registration is asked, checked and put together before it takes its time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from picoradar.registration.errors import RegistrationError
from picoradar.registration.model import Model
from picoradar.registration.settings import RobustSettings
from picoradar.registration.trust import (
    ErrorBudget,
    Socket,
    TargetsLike,
    named_targets,
)

MIN_NOISE_MM, MAX_NOISE_MM = 1e-3, 100.0
"""Range noise that can be given; a common range error at most."""

USUAL = RobustSettings()
"""Settings where none are given: making them takes as long as a few steps of a registration."""


def check_noise(noise_mm: float | None) -> None:
    """Refuse a range noise that no instrument has.

    Raises
    ------
    RegistrationError
    """
    if noise_mm is not None and not MIN_NOISE_MM <= noise_mm <= MAX_NOISE_MM:
        raise RegistrationError(
            f"noise_mm is {noise_mm}: give a number from {MIN_NOISE_MM:g} to {MAX_NOISE_MM:g} mm, or leave it out"
        )


def sockets_of(model: Model) -> list[Socket]:
    """Sockets of a model, which words about free motions refer to."""
    return [Socket(view.centre, view.radius_mm, view.axis, model.vertices) for view in model.views if view.is_socket]


def with_model_noise(settings: RobustSettings, budget: ErrorBudget) -> RobustSettings:
    """Settings whose noise holds at least the model's error of a budget."""
    if budget.sigma_model_mm <= settings.noise.model_mm:
        return settings
    return replace(settings, noise=replace(settings.noise, model_mm=budget.sigma_model_mm))


def budget_with(
    budget: ErrorBudget | None,
    range_bias_mm: float | None = None,
    sigma_model_mm: float | None = None,
    model_offset_mm: float | None = None,
) -> ErrorBudget:
    """The budget with what was given on its own.

    Raises
    ------
    RegistrationError
        If one is no standard deviation in mm.
    """
    return ErrorBudget(
        **{
            **vars(budget or ErrorBudget()),
            **{
                name: value
                for name, value in (
                    ("range_bias_mm", range_bias_mm),
                    ("sigma_model_mm", sigma_model_mm),
                    ("model_offset_mm", model_offset_mm),
                )
                if value is not None
            },
        }
    )


def check_targets(targets: TargetsLike) -> None:
    """Refuse targets that cannot be used, before a registration takes its time.

    Raises
    ------
    RegistrationError
        If targets are neither finite (M, 3) nor dicts with a finite "position".
    """
    for name, position in named_targets(targets, np.zeros(3)):
        if not np.isfinite(position).all():
            raise RegistrationError(f"{name} is at {position.tolist()}: give finite numbers, model frame, mm")
