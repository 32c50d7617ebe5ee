"""The measured side of a registration: points with what the instrument knows about them, checked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from registration._types import BoolArray, FloatArray, IntArray, Neighbours
from registration.errors import DegenerateError, PointsError
from registration.raster import found_grid, neighbours, thinned

MIN_POINTS = 6
"""A rigid pose has six unknowns."""


@dataclass(frozen=True)
class Scan:
    """Measured points in the scanner frame.

    Attributes
    ----------
    points : (N, 3) array
        mm.
    beams : (N, 3) array
        Unit directions from the scanner's origin to the points: where the light came from.
    origin : (3,) array
    covariance : (N, 3, 3) array or None
        mm^2.
    response_mv : (N,) array or None
        Amplitude of the echo.
    grid : (N, 2) array of int or None
        Row and column in the raster.
    """

    points: FloatArray
    beams: FloatArray
    origin: FloatArray
    covariance: FloatArray | None = None
    response_mv: FloatArray | None = None
    grid: IntArray | None = None

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def raster(self) -> IntArray | None:
        """Rows and columns (N, 2): those given, else those that the beams show; None when they lie on no raster."""
        return self.grid if self.grid is not None else found_grid(self.beams)

    @cached_property
    def around(self) -> Neighbours:
        """Indices (N, 8) of each point's neighbours in the raster; N stands for "none there"."""
        return neighbours(self.beams, self.raster)

    def part(self, chosen: IntArray | BoolArray, grid: IntArray | None = None) -> Scan:
        """Some of the points, by index or mark, with other rows and columns if these are given."""
        covariance = None if self.covariance is None else self.covariance[chosen]
        response = None if self.response_mv is None else self.response_mv[chosen]
        if grid is None and self.raster is not None:
            grid = self.raster[chosen]
        return Scan(self.points[chosen], self.beams[chosen], self.origin, covariance, response, grid)

    def thinned(self, count: int) -> Scan:
        """At most about `count` points, evenly spread in the raster; drawn at random where there is none."""
        every = -(-len(self) // count)
        if every == 1:
            return self
        if self.raster is None:
            return self.part(np.sort(np.random.default_rng(0).permutation(len(self))[:count]))
        return self.part(*thinned(self.raster, every))

    @cached_property
    def ranges(self) -> FloatArray:
        """Distances (N,) mm from the origin."""
        return np.asarray(np.linalg.norm(self.points - self.origin, axis=1), dtype=np.float64)


def checked_scan(
    points: npt.ArrayLike,
    *,
    origin: npt.ArrayLike = (0.0, 0.0, 0.0),
    covariance: npt.ArrayLike | None = None,
    response_mv: npt.ArrayLike | None = None,
    grid: npt.ArrayLike | None = None,
) -> Scan:
    """Check measured points.

    Raises
    ------
    PointsError
        For wrong shapes or units, fewer than six points, NaN or infinite values, or a point at the scanner's origin.
    DegenerateError
        For points on one line.
    """
    p = np.ascontiguousarray(points, dtype=np.float64)
    if p.size == 0:
        raise PointsError("there are no points: the cloud is empty")
    if p.ndim != 2 or p.shape[1] != 3:
        raise PointsError(f"points have shape {p.shape}: give (N, 3) in mm")
    finite = np.isfinite(p).all(axis=1)
    if not finite.all():
        raise PointsError(
            f"{int((~finite).sum())} of {len(p)} points hold NaN or infinite values (first: row "
            f"{int(np.argmin(finite))}): leave out beams without an echo"
        )
    if len(p) < MIN_POINTS:
        raise PointsError(f"{len(p)} points: a pose has six unknowns, so at least {MIN_POINTS} points are needed")
    extent = float(np.ptp(p, axis=0).max())
    if extent < 1.0:
        raise PointsError(f"the cloud measures {extent:.3g} across: it seems to be in metres; scale it by 1000 to mm")
    local = p - p.mean(axis=0)
    spread = np.linalg.eigvalsh(local.T @ local)
    if spread[1] <= 1e-12 * spread[2]:
        raise DegenerateError("all points lie on one line: the rotation about it is free; scan an area")
    o = _sized(origin, (3,), "origin")
    offset = p - o
    distance = np.linalg.norm(offset, axis=1)
    if distance.min() < 1e-6:
        raise PointsError(
            f"point {int(np.argmin(distance))} lies at the scanner's origin {o.tolist()}: give the true origin"
        )
    checked_grid = None
    if grid is not None:
        g = np.asarray(grid)
        if g.shape != (len(p), 2) or not np.issubdtype(g.dtype, np.integer):
            raise PointsError(f"grid has shape {g.shape} and type {g.dtype}: give whole numbers ({len(p)}, 2)")
        checked_grid = g.astype(np.int64)
    checked_covariance = None
    if covariance is not None:
        checked_covariance = _sized(covariance, (len(p), 3, 3), "covariance")
        if np.linalg.eigvalsh(checked_covariance).min() < 0:
            raise PointsError("covariance holds a matrix with a negative variance")
    response = None if response_mv is None else _sized(response_mv, (len(p),), "response_mv")
    return Scan(p, offset / distance[:, None], o, checked_covariance, response, checked_grid)


def _sized(values: npt.ArrayLike, shape: tuple[int, ...], name: str) -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise PointsError(f"{name} has shape {array.shape}: give finite numbers of shape {shape}")
    return array
