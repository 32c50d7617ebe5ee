"""`GrowingCloud`: the lines so far as one scan, with what belongs to each point made once, when its line comes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import BoolArray, FloatArray, IntArray
from picoradar.registration.errors import PointsError
from picoradar.registration.register.live.line import MeasuredLine
from picoradar.registration.scan import Scan, checked_grid


class GrowingCloud:
    """Measured points that become more.

    Parameters
    ----------
    origin : (3,) array
        Where the beams come from, scanner frame, mm.
    """

    def __init__(self, origin: npt.ArrayLike) -> None:
        self.origin = np.asarray(origin, dtype=np.float64)
        if self.origin.shape != (3,) or not np.isfinite(self.origin).all():
            raise PointsError(f"origin has shape {self.origin.shape}: give finite numbers of shape (3,)")
        self.lines: tuple[int, ...] = ()
        self.points = self.beams = np.empty((0, 3))
        self.covariance: FloatArray | None = np.empty((0, 3, 3))
        self.response_mv: FloatArray | None = np.empty(0)
        self.grid: IntArray = np.empty((0, 2), dtype=np.int64)

    def __len__(self) -> int:
        return len(self.points)

    def add(self, line: MeasuredLine) -> int:
        """Take a line in and return how many of its points can be used.

        What some lines lack, covariances or responses, is used of none.

        Raises
        ------
        PointsError
            When its arrays do not fit each other, or its row has been there before; nothing is taken in then.
        """
        points = np.asarray(line.points_mm, dtype=np.float64)
        columns = np.asarray(line.columns)
        count = len(columns)
        if points.shape != (count, 3):
            raise PointsError(f"line {line.index}: points have shape {points.shape}, with {count} columns")
        if line.index in self.lines:
            raise PointsError(f"line {line.index} has been added already")
        there = np.asarray(np.isfinite(points).all(axis=1))
        covariance = _of_line(line.covariance_mm2, (count, 3, 3), f"line {line.index}: covariance")
        response = _of_line(line.response_mv, (count,), f"line {line.index}: response")
        for known in (covariance, response):
            if known is not None:
                there &= np.isfinite(known).reshape(count, -1).all(axis=1)
        offset = points[there] - self.origin
        distance = np.linalg.norm(offset, axis=1)
        if not (distance > 0.0).all():
            raise PointsError(f"line {line.index}: a point lies at the scanner's origin")
        self.lines += (int(line.index),)
        self.points = np.concatenate([self.points, points[there]])
        self.beams = np.concatenate([self.beams, offset / distance[:, None]])
        self.covariance = _joined(self.covariance, covariance, there)
        self.response_mv = _joined(self.response_mv, response, there)
        places = np.column_stack([np.full(len(distance), line.index), columns[there]]).astype(np.int64)
        self.grid = np.concatenate([self.grid, places])
        return len(distance)

    def part(self, count: int) -> BoolArray:
        """Mark (N,) about `count` of the points: all, or those of one column in so many, so that every line has some
        and neighbours stay neighbours in a coarser raster."""
        every = max(1, round(len(self) / count))
        return np.asarray(self.grid[:, 1] % every == 0)

    def scan(self, chosen: BoolArray | None = None) -> Scan:
        """The points so far, or those marked in `chosen` (N,), as a scan."""
        if chosen is None or chosen.all():
            return Scan(
                self.points, self.beams, self.origin, self.covariance, self.response_mv, checked_grid(self.grid)
            )
        return Scan(
            self.points[chosen],
            self.beams[chosen],
            self.origin,
            None if self.covariance is None else self.covariance[chosen],
            None if self.response_mv is None else self.response_mv[chosen],
            checked_grid(self.grid[chosen]),
        )


def _of_line(values: npt.ArrayLike | None, shape: tuple[int, ...], name: str) -> FloatArray | None:
    if values is None:
        return None
    array = np.asarray(values, dtype=np.float64)
    if array.shape != shape:
        raise PointsError(f"{name} has shape {array.shape}: give {shape}")
    return array


def _joined(known: FloatArray | None, more: FloatArray | None, there: BoolArray) -> FloatArray | None:
    return None if known is None or more is None else np.concatenate([known, more[there]])
