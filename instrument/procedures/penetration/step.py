"""The step along the beam from the painted to the bare half of a flat piece.

The plane leans as its painted half does, by the least noisy ranges of the scan: bare tissue differs from place to place
and would turn it. All ways of ranging share that plane, and then differ by means alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

BLOCK_MM = 4.0  # points nearer than this may share an error: the surface of moist tissue changes from place to place


class Half(NamedTuple):
    """Points (N, 3) mm of one half, unit vectors (N, 3) along which a range error moves each, and responses (N,) in mV;
    scanner frame."""

    points_mm: FloatArray
    beams: FloatArray
    response_mv: FloatArray


class Lean(NamedTuple):
    """Slopes (2,) of a plane z = a x + b y + c and its c (mm), the slopes' covariance (2, 2), and its points' rms
    distance along z (mm)."""

    slopes: FloatArray
    middle_mm: float
    covariance: FloatArray
    flatness_mm: float


class Step(NamedTuple):
    """The step along the beam.

    Attributes
    ----------
    step_mm, sd_mm : float
        Bare minus painted half, and its standard deviation, where errors within `BLOCK_MM` may be shared.
    bare, painted : int
        Points on each half.
    bare_mv, painted_mv : float
        Mean response of each half.
    place_sd_mm : float
        By how much the bare half scatters about its plane beyond the painted one: the bias differs from place to place.
    """

    step_mm: float
    sd_mm: float
    bare: int
    painted: int
    bare_mv: float
    painted_mv: float
    place_sd_mm: float


def fit_lean(half: Half) -> Lean:
    """Fit a plane to a half, with a covariance that allows for errors shared within blocks (Liang and Zeger, Biometrika
    73 (1986) 13)."""
    x, y, z = half.points_mm.T
    design = np.column_stack([x, y, np.ones_like(x)])
    values = np.linalg.lstsq(design, z, rcond=None)[0]
    off_mm = z - design @ values
    shares = _sums(half, design * off_mm[:, None])
    inverse = np.linalg.inv(design.T @ design)
    few = len(shares) / max(len(shares) - design.shape[1], 1)
    covariance = inverse @ (shares.T @ shares) @ inverse * few
    return Lean(values[:2], float(values[2]), covariance[:2, :2], float(np.sqrt(np.mean(off_mm**2))))


def step_between(painted: Half, bare: Half, lean: Lean) -> Step:
    """Return how far the bare half stands behind the painted one along the beam, both on planes of this lean."""
    front_mm, front_sd_mm, front_rms_mm = _place(painted, lean)
    back_mm, back_sd_mm, back_rms_mm = _place(bare, lean)
    apart = bare.points_mm[:, :2].mean(axis=0) - painted.points_mm[:, :2].mean(axis=0)
    lean_variance = float(apart @ lean.covariance @ apart)
    return Step(
        step_mm=back_mm - front_mm,
        sd_mm=float(np.sqrt(front_sd_mm**2 + back_sd_mm**2 + lean_variance)),
        bare=len(bare.points_mm),
        painted=len(painted.points_mm),
        bare_mv=float(bare.response_mv.mean()),
        painted_mv=float(painted.response_mv.mean()),
        place_sd_mm=float(np.sqrt(max(back_rms_mm**2 - front_rms_mm**2, 0.0))),
    )


def _place(half: Half, lean: Lean) -> tuple[float, float, float]:
    """Return the mean distance along the beam from the plane, its standard deviation, and the scatter about it."""
    across, deep = half.points_mm[:, :2], half.points_mm[:, 2]
    along_mm = (deep - across @ lean.slopes - lean.middle_mm) / (half.beams[:, 2] - half.beams[:, :2] @ lean.slopes)
    mean_mm = float(along_mm.mean())
    shares = _sums(half, (along_mm - mean_mm)[:, None])
    few = len(shares) / max(len(shares) - 1, 1)
    return mean_mm, float(np.sqrt((shares**2).sum() * few) / len(along_mm)), float(along_mm.std())


def block_means(places_mm: FloatArray, values: FloatArray) -> FloatArray:
    """Return the mean value (B,) in each block of the places (N, 2) where there are some."""
    blocks = _blocks(places_mm)
    return np.asarray(np.bincount(blocks, values) / np.bincount(blocks), dtype=np.float64)


def _blocks(places_mm: FloatArray) -> NDArray[np.intp]:
    """Number the blocks in which places (N, 2) lie."""
    places = np.floor(places_mm / BLOCK_MM)
    return np.asarray(np.unique(places, axis=0, return_inverse=True)[1], dtype=np.intp).reshape(-1)


def _sums(half: Half, values: FloatArray) -> FloatArray:
    """Sum the rows (N, K) of the points in each block."""
    blocks = _blocks(half.points_mm[:, :2])
    sums = np.zeros((int(blocks.max()) + 1, values.shape[1]))
    np.add.at(sums, blocks, values)
    return sums
