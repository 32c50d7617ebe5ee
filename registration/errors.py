"""Refusals of the registration package: what was found, and what to do about it."""

from __future__ import annotations


class RegistrationError(ValueError):
    """Base of every refusal: the input cannot be registered as it stands."""


class MeshError(RegistrationError):
    """The model is no usable surface in millimetres."""


class PointsError(RegistrationError):
    """The measured points, or what belongs to them, cannot be used."""


class StartError(RegistrationError):
    """The start pose or the landmarks cannot be used."""


class DegenerateError(RegistrationError):
    """The geometry leaves a motion free, so that no unique pose exists."""
