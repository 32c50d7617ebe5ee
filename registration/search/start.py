"""Where a registration starts: anywhere, a cone of directions, a pose, or landmark pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import DegenerateError, PointsError, StartError
from picoradar.registration.paired_points import paired_points
from picoradar.registration.se3 import checked_pose
from picoradar.registration.search.cone import Cone


@dataclass(frozen=True)
class Landmarks:
    """Points picked in both frames.

    Attributes
    ----------
    scanner, model : (K, 3) arrays
        The same K points in the scanner frame and in the model frame, mm.
    names : tuple of str
    """

    scanner: FloatArray
    model: FloatArray
    names: tuple[str, ...] = ()

    @classmethod
    def from_pairs(cls, pairs: Sequence[Mapping[str, Any]]) -> Landmarks:
        """Make landmarks of ``[{"scanner": [x, y, z], "model": [x, y, z], "name": ...}, ...]``.

        Raises
        ------
        StartError
            If an entry lacks a key or holds no three finite numbers.
        """
        for index, pair in enumerate(pairs):
            for key in ("scanner", "model"):
                if not isinstance(pair, Mapping) or key not in pair or not _three_numbers(pair[key]):
                    raise StartError(f'landmark {index} has no "{key}" with three finite numbers (mm)')
        return cls(
            scanner=np.array([pair["scanner"] for pair in pairs], dtype=np.float64).reshape(-1, 3),
            model=np.array([pair["model"] for pair in pairs], dtype=np.float64).reshape(-1, 3),
            names=tuple(str(pair.get("name", f"landmark {index + 1}")) for index, pair in enumerate(pairs)),
        )


Start: TypeAlias = str | Landmarks | Sequence[Mapping[str, Any]] | Cone | Mapping[str, Any] | npt.ArrayLike


def checked_start(start: Start) -> FloatArray | Cone | None:
    """Return the 4x4 `model_from_scanner` that `start` stands for, or the cone; None for ``"any"``.

    Raises
    ------
    StartError
        If it is none of the accepted forms, or the landmarks do not fix a pose.
    """
    if isinstance(start, str):
        if start != "any":
            raise StartError(f"start is {start!r}: give 'any', a cone of directions, a 4x4 pose or landmarks")
        return None
    if isinstance(start, Cone):
        return start
    if isinstance(start, Mapping):
        return Cone.from_mapping(start)
    if isinstance(start, Sequence) and len(start) > 0 and isinstance(start[0], Mapping):
        start = Landmarks.from_pairs(cast("Sequence[Mapping[str, Any]]", start))
    if isinstance(start, Landmarks):
        try:
            return paired_points(start.model, start.scanner).fixed_from_moving
        except (PointsError, DegenerateError) as error:
            raise StartError(f"the landmarks do not fix a start pose: {error}") from error
    try:
        matrix = np.asarray(start, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise StartError(f"the start pose is no 4x4 matrix of numbers ({error})") from error
    return checked_pose(matrix)


def _three_numbers(value: object) -> bool:
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return False
    return numbers.shape == (3,) and bool(np.isfinite(numbers).all())
