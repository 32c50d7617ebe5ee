"""Where a registration starts: anywhere, a cone of directions, a pose, or landmark pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import DegenerateError, PointsError, StartError
from picoradar.registration.paired_points import paired_points
from picoradar.registration.se3 import checked_pose
from picoradar.registration.search.cone import Cone
from picoradar.registration.search.landmarks import Landmarks

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
    if (marks := landmarks_of(start)) is not None:
        try:
            return paired_points(marks.model, marks.scanner).fixed_from_moving
        except (PointsError, DegenerateError) as error:
            raise StartError(f"the landmarks do not fix a start pose: {error}") from error
    try:
        matrix = np.asarray(start, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise StartError(f"the start pose is no 4x4 matrix of numbers ({error})") from error
    return checked_pose(matrix)


def landmarks_of(start: Start) -> Landmarks | None:
    """Return the landmarks that a start holds; None when it is another kind of start.

    Raises
    ------
    StartError
        If a pair cannot be used.
    """
    if isinstance(start, Landmarks):
        return start
    if isinstance(start, Sequence) and len(start) > 0 and isinstance(start[0], Mapping):
        return Landmarks.from_pairs(cast("Sequence[Mapping[str, Any]]", start))
    return None
