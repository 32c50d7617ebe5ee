"""Are paired points what they are said to be? Names a pair that is off, and two that were exchanged.

A residual by itself says little: a pair far outside pulls the pose to itself, and its residual stays small. What counts
is how much better the others agree without it, against what noise alone would do.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import DegenerateError, PointsError
from picoradar.registration.paired_points.checks import checked, refuse_collinear
from picoradar.registration.paired_points.closed_form import horn
from picoradar.registration.se3 import transform

FALSE_ALARMS = 0.01
"""Good sets of pairs of which one is named, as a share, by each of the two tests."""

LEAST_PAIRS = 3
"""That a pose needs; so many must be left when one is taken away, and one more to tell that they agree."""


@dataclass(frozen=True)
class PairsJudged:
    """What a set of pairs says of itself.

    Attributes
    ----------
    fre_mm, expected_fre_mm : float
        Root mean square residual; and what it is to be by the localisation error (NaN where that is not given).
    residual_mm, expected_mm : (N,) arrays
        Of each pair, and what is to be expected of it by the localisation error given, else by the one that the pairs
        show: less where the pair itself holds the pose.
    off : int or None
        The pair without which the others agree.
    exchanged : (int, int) or None
        Two pairs that agree with the others once their partners are exchanged.
    sentences : tuple of str
        The same in words, empty where nothing is wrong.
    """

    fre_mm: float
    expected_fre_mm: float
    residual_mm: FloatArray
    expected_mm: FloatArray
    off: int | None
    exchanged: tuple[int, int] | None
    sentences: tuple[str, ...]


def judge_pairs(
    fixed: npt.ArrayLike, moving: npt.ArrayLike, *, fle_mm: float | None = None, names: Sequence[str] = ()
) -> PairsJudged:
    """Judge pairs of points.

    Parameters
    ----------
    fixed, moving : (N, 3) arrays
        mm, N at least 3.
    fle_mm : float, optional
        Localisation error of a pair, root mean square over three axes, of both sides together. Without it the other
        pairs tell what is usual: five are needed to name one.
    names : sequence of str, optional
        For the sentences.

    Raises
    ------
    PointsError
        For arrays of wrong shape, or a localisation error that is not positive.
    DegenerateError
        For points on a line.
    """
    b, a = checked(fixed, "fixed"), checked(moving, "moving")
    if a.shape != b.shape:
        raise PointsError(f"paired points come in pairs: {len(b)} fixed and {len(a)} moving points were given")
    if fle_mm is not None and not fle_mm > 0:
        raise PointsError(f"fle_mm is {fle_mm}: give the localisation error of a pair, rms over three axes, in mm")
    for name, points in (("fixed", b), ("moving", a)):
        refuse_collinear(points, name)
    count, square = len(b), _square(b, a)
    found = transform(horn(b, a), a)
    variance = fle_mm**2 if fle_mm is not None else square / max(count - 2, 1)
    expected = np.sqrt(variance * np.maximum(1.0 - _leverage(b), 0.0))
    exchanged = _exchanged(b, a, square, fle_mm)
    off = None if exchanged else _off(b, a, square, fle_mm)
    named = list(names) or [f"pair {k + 1}" for k in range(count)]
    return PairsJudged(
        fre_mm=float(np.sqrt(square / count)),
        expected_fre_mm=float("nan") if fle_mm is None else fle_mm * float(np.sqrt(1.0 - 2.0 / count)),
        residual_mm=np.linalg.norm(b - found, axis=1),
        expected_mm=expected,
        off=off,
        exchanged=exchanged,
        sentences=tuple(_sentences(named, off, exchanged, (b, a), fle_mm)),
    )


def _square(b: FloatArray, a: FloatArray) -> float:
    """Sum of the squared residuals of pairs (N, 3), mm^2."""
    return float(((b - transform(horn(b, a), a)) ** 2).sum())


def _leverage(b: FloatArray) -> FloatArray:
    """Share (N,) of its own error that each pair takes into the pose: ``<TRE^2> / <FLE^2>`` at its place
    (Fitzpatrick, West and Maurer 1998, equation 46)."""
    centred = b - b.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    along = centred @ axes.T
    from_axis2 = (centred**2).sum(axis=1)[:, None] - along**2
    return np.asarray(1.0 / len(b) + (from_axis2 / from_axis2.sum(axis=0)).sum(axis=1) / 3.0, dtype=np.float64)


def _agree_only_without(less: float, more: float, count: int, tries: int, fle_mm: float | None) -> bool:
    """Whether a sum of squares falls by more than noise lets it (from `more` to `less`) when one of `count` pairs is
    mended, chosen among so many tries."""
    from scipy import stats  # its import takes the time of six registrations

    alarm = FALSE_ALARMS / tries
    if fle_mm is not None:
        limit = stats.chi2.isf(alarm, 3)
        return (more - less) / (fle_mm**2 / 3.0) > limit
    freedom = 3 * (count - 1) - 6
    if freedom < 6:
        return False
    return (more - less) / 3.0 > stats.f.isf(alarm, 3, freedom) * max(less, 1e-300) / freedom


def _off(b: FloatArray, a: FloatArray, square: float, fle_mm: float | None) -> int | None:
    count = len(b)
    if count <= LEAST_PAIRS:
        return None
    without = []
    for k in range(count):
        rest = np.arange(count) != k
        try:
            refuse_collinear(b[rest], "fixed")
            without.append(_square(b[rest], a[rest]))
        except DegenerateError:
            without.append(np.inf)
    best = int(np.argmin(without))
    return best if _agree_only_without(without[best], square, count, count, fle_mm) else None


def _exchanged(b: FloatArray, a: FloatArray, square: float, fle_mm: float | None) -> tuple[int, int] | None:
    """Two pairs that fit as well as the others once exchanged: then nothing is left that is off."""
    count = len(b)
    pairs = list(itertools.combinations(range(count), 2))
    swapped = []
    for i, j in pairs:
        order = np.arange(count)
        order[[i, j]] = j, i
        swapped.append(_square(b, a[order]))
    best = int(np.argmin(swapped))
    if not _agree_only_without(swapped[best], square, count + 1, len(pairs), fle_mm):
        return None
    i, j = pairs[best]
    rest = [k for k in range(count) if k not in (i, j)]
    scale = fle_mm**2 / 3.0 if fle_mm is not None else _usual(b[rest], a[rest])
    return (i, j) if swapped[best] < scale * _usual_sum(count) else None


def _usual_sum(count: int) -> float:
    """Sum of squares, in variances of one axis, that good pairs exceed in one set of a hundred."""
    from scipy import stats

    return float(stats.chi2.isf(FALSE_ALARMS, 3 * count - 6))


def _usual(b: FloatArray, a: FloatArray) -> float:
    """Variance (mm^2) of one axis that pairs show among themselves; infinite where they are too few to tell."""
    return _square(b, a) / (3 * len(b) - 6) if len(b) > LEAST_PAIRS else np.inf


def _sentences(
    names: Sequence[str],
    off: int | None,
    exchanged: tuple[int, int] | None,
    pairs: tuple[FloatArray, FloatArray],
    fle_mm: float | None,
) -> list[str]:
    b, a = pairs
    if exchanged is not None:
        one, other = (names[k] for k in exchanged)
        return [f"{one} and {other} seem to be exchanged: with their partners changed over, all pairs agree."]
    if off is not None:
        rest = np.arange(len(b)) != off
        away = float(np.linalg.norm(b[off] - transform(horn(b[rest], a[rest]), a[off : off + 1])[0]))
        return [f"{names[off]} is off by {away:.1f} mm from where the other pairs put it: click it again."]
    if fle_mm is not None:
        square = _square(b, a)
        if square / (fle_mm**2 / 3.0) > _usual_sum(len(b)):
            seen, expected = np.sqrt(square / len(b)), fle_mm * np.sqrt(1.0 - 2.0 / len(b))
            return [
                f"The pairs agree to {seen:.1f} mm, {expected:.1f} mm are expected by their localisation error: "
                "several are off, or it is greater."
            ]
    return []
