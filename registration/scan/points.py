"""The measured side of a registration: points with what the instrument knows about them, checked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import BoolArray, FloatArray, IntArray, Neighbours
from picoradar.registration.errors import DegenerateError, PointsError
from picoradar.registration.scan.raster import checked_grid, found_grid, neighbours, thinned

MIN_COMMON_LENGTH = 0.05
"""Length of the mean of all beams below which they have no common direction."""

COLLINEAR = 1e-12
"""Points whose second moment of inertia is a smaller share of the first lie on one line."""

MIN_EXTENT_MM = 1.0
"""A smaller cloud is in metres."""

MIN_RANGE_MM = 1e-6
"""A nearer point has no direction from the scanner."""

MAX_ASYMMETRY, MAX_NEGATIVE = 1e-6, 1e-9
"""Rounding that a covariance may show, as shares of its largest entry and variance: it may come from a text file."""

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
    range_sd_mm : (N,) array or None
        Standard deviation along the beam where there is no covariance, but the amplitudes tell as much.
    response_mv : (N,) array or None
        Amplitude of the echo.
    grid : (N, 2) array of int or None
        Row and column in the raster.
    scattered : bool
        The points were drawn at random: whatever raster they come from, their neighbours are the nearest ones.
    """

    points: FloatArray
    beams: FloatArray
    origin: FloatArray
    covariance: FloatArray | None = None
    response_mv: FloatArray | None = None
    grid: IntArray | None = None
    scattered: bool = False
    range_sd_mm: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.points)

    @property
    def noise_known(self) -> bool:
        """Whether the noise of every single point is given."""
        return self.covariance is not None or self.range_sd_mm is not None

    @cached_property
    def raster(self) -> IntArray | None:
        """Rows and columns (N, 2): those given, else those that the beams show; None when they lie on no raster."""
        if self.grid is not None or self.scattered:
            return self.grid
        return found_grid(self.beams)

    @cached_property
    def around(self) -> Neighbours:
        """Indices (N, 8) of each point's neighbours in the raster; N stands for "none there"."""
        return neighbours(self.beams, self.raster)

    def part(self, chosen: IntArray | BoolArray) -> Scan:
        """Some of the points, by index or mark."""
        return replace(
            self,
            points=self.points[chosen],
            beams=self.beams[chosen],
            covariance=None if self.covariance is None else self.covariance[chosen],
            range_sd_mm=None if self.range_sd_mm is None else self.range_sd_mm[chosen],
            response_mv=None if self.response_mv is None else self.response_mv[chosen],
            grid=None if self.raster is None else self.raster[chosen],
            scattered=self.raster is None,
        )

    def moved_along(self, by_mm: FloatArray) -> Scan:
        """Points farther along their beams by (N,) mm."""
        return replace(self, points=self.points + self.beams * by_mm[:, None], grid=self.raster)

    def thinned(self, count: int, among: BoolArray | None = None) -> Scan:
        """About `count` points, evenly spread in the raster; drawn at random where that cannot be.

        Parameters
        ----------
        count : int
        among : (N,) array of bool, optional
            Points to take them from.
        """
        marked = np.ones(len(self), dtype=np.bool_) if among is None else among
        every = round(int(marked.sum()) / count)
        if every <= 1:
            return self if among is None else self.part(among)
        even = None if self.raster is None else thinned(self.raster, every)
        if even is None:
            drawn = np.random.default_rng(0).permutation(np.flatnonzero(marked))[:count]
            return replace(self.part(np.sort(drawn)), grid=None, scattered=True)
        chosen, coarse = (part[marked[even[0]]] for part in even)
        return replace(self.part(chosen), grid=coarse)

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
    if extent < MIN_EXTENT_MM:
        raise PointsError(f"the cloud measures {extent:.3g} across: it seems to be in metres; scale it by 1000 to mm")
    local = p - p.mean(axis=0)
    spread = np.linalg.eigvalsh(local.T @ local)
    if spread[1] <= COLLINEAR * spread[2]:
        raise DegenerateError("all points lie on one line: the rotation about it is free; scan an area")
    o = _sized(origin, (3,), "origin")
    offset = p - o
    distance = np.linalg.norm(offset, axis=1)
    if distance.min() < MIN_RANGE_MM:
        raise PointsError(
            f"point {int(np.argmin(distance))} lies at the scanner's origin {o.tolist()}: give the true origin"
        )
    places = None
    if grid is not None:
        g = np.asarray(grid)
        if g.shape != (len(p), 2) or not np.issubdtype(g.dtype, np.integer):
            raise PointsError(f"grid has shape {g.shape} and type {g.dtype}: give whole numbers ({len(p)}, 2)")
        places = checked_grid(g.astype(np.int64))
    beams = offset / distance[:, None]
    if np.linalg.norm(beams.mean(axis=0)) < MIN_COMMON_LENGTH:
        raise PointsError(f"the beams go to all sides: the scanner's origin {o.tolist()} lies within the cloud")
    checked_covariance = None if covariance is None else _checked_covariance(covariance, len(p))
    response = None if response_mv is None else _sized(response_mv, (len(p),), "response_mv")
    return Scan(p, beams, o, checked_covariance, response, places)


def _checked_covariance(covariance: npt.ArrayLike, count: int) -> FloatArray:
    c = _sized(covariance, (count, 3, 3), "covariance")
    largest = np.abs(c).max(axis=(1, 2))
    if (np.abs(c - c.transpose(0, 2, 1)).max(axis=(1, 2)) > MAX_ASYMMETRY * largest).any():
        raise PointsError("covariance holds a matrix that is not symmetric")
    variances = np.linalg.eigvalsh(c)
    if (variances[:, 0] < -MAX_NEGATIVE * variances[:, 2]).any() or variances[:, 2].min() <= 0.0:
        raise PointsError("covariance holds a matrix with a negative variance, or with none at all: leave it out")
    return c


def _sized(values: npt.ArrayLike, shape: tuple[int, ...], name: str) -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise PointsError(f"{name} has shape {array.shape}: give finite numbers of shape {shape}")
    return array
