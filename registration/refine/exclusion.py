"""Regions of the model that take no part in a registration, as spheres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.errors import RegistrationError


def excluded_regions(exclude: Sequence[Mapping[str, Any]] | None) -> FloatArray:
    """Spheres (K, 4) of centre and radius.

    Raises
    ------
    RegistrationError
        If an entry lacks "center" or "radius_mm".
    """
    rows = []
    for index, region in enumerate(exclude or ()):
        try:
            row = [*np.asarray(region["center"], dtype=np.float64).reshape(3), float(region["radius_mm"])]
        except (KeyError, TypeError, ValueError) as error:
            raise RegistrationError(
                f'excluded region {index} is no {{"center": [x, y, z], "radius_mm": r}} ({error})'
            ) from error
        rows.append(row)
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def outside_regions(points: FloatArray, regions: FloatArray) -> BoolArray:
    """Points (N,) that lie in none of the spheres `regions` (K, 4)."""
    outside = np.ones(len(points), dtype=np.bool_)
    for region in regions:
        outside &= ((points - region[:3]) ** 2).sum(axis=1) > region[3] ** 2
    return outside
