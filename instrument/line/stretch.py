"""`unstretched`: ranges corrected by how far light from inside the target has stretched their echoes.

A scan that is ranged as bone has the bias of the piece that was measured taken off every range. Its echoes say how
far this bone, and what lies beside it, differs from the piece. The stretch of a single echo is too noisy for that, so
it is averaged over the surface around it, as far as that is alike, and over the scan; what the echoes cannot tell
stays as the calibration has it.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

FIRST = 2
"""Reach of the square of neighbours whose median is where averaging begins: a median keeps edges."""
MEDIAN_VARIANCE = math.pi / 2
"""Of the median of normal deviates, over that of their mean."""
RADII = (3.4, 5.1, 7.7, 11.5)
"""Growing neighbourhoods, in steps of the raster: half as wide again each time."""
ALIKE = 10.0
"""Squared difference, over its variance, from which on surfaces are unlike (of normal noise, 1.6 in 1000 are)."""
LEAST = 0.02
"""Least stretch of a whole scan for the deviation of the power law: that of blood, which lets the least light in."""
SHARES = np.linspace(0.0, 1.6, 161)
"""Biases that are thought possible, over that of the piece; fat has 1.25, 1.5 at grazing incidence."""
RADAR_SD = 0.03
"""Standard deviation of the stretch that paint seems to have, as a pulse is not quite that of the calibration: from
bench to bench in the simulator's second world."""
OPAQUE = 0.5
"""Share of surfaces that let no light in, before anything is seen: between them and blood nothing is known."""

MOST_STRETCH, LEAST_VARIANCE, MOST_VARIANCE = 1e3, 1e-9, 1e6
"""What no echo goes beyond; values outside are taken as not known."""
MOST_CELLS = 64
"""Cells of the raster for each point; a raster with more holes is averaged as a whole."""


class StretchTerms(NamedTuple):
    """What is known before a scan.

    Attributes
    ----------
    bias_mm : float
        Of the piece that was measured, taken off each range.
    rest_mm : float
        Standard deviation of the common range error without that of carrying the bias over.
    piece_sd : float
        Standard deviation of the stretch between two pieces.
    power, power_sd : float
        The bias goes as this power of the stretch.
    law_sd : float
        Relative deviation of the bias of pieces of the same stretch.
    place_sd_mm : float
        Standard deviation of the bias from place to place.
    """

    bias_mm: float
    rest_mm: float
    piece_sd: float
    power: float
    power_sd: float
    law_sd: float
    place_sd_mm: float = 0.0

    @classmethod
    def of(cls, known: Mapping[str, float]) -> StretchTerms:
        """Take them from the header of a recording."""
        return cls(**{name: float(known[name]) for name in cls._fields if name in known})


class Unstretched(NamedTuple):
    """Correction of N ranges.

    Attributes
    ----------
    change_mm, variance_mm2 : (N,) float arrays
        What is added to each range, and to its variance.
    stretch, stretch_sd : float
        Of the scan as a whole, and its standard deviation.
    sd_mm : float
        Standard deviation of the common range error that is left.
    place_variance_mm2 : (N,) float array
        Of the bias from place to place, which no repeating makes smaller: it belongs to the points, not to the ranges.
    """

    change_mm: FloatArray
    variance_mm2: FloatArray
    stretch: float
    stretch_sd: float
    sd_mm: float
    place_variance_mm2: FloatArray


def unstretched(
    terms: StretchTerms, share: FloatArray, variance: FloatArray, rows: IntArray, columns: IntArray
) -> Unstretched | None:
    """Correct ranges for the stretch of their echoes.

    Parameters
    ----------
    terms : StretchTerms
    share, variance : (N,) float arrays
        Stretch of each echo and its variance; NaN where it is not known.
    rows, columns : (N,) int arrays
        In the raster.

    Returns
    -------
    Unstretched or None
        None where no echo tells its stretch.
    """
    with np.errstate(invalid="ignore"):
        known = (np.abs(share) < MOST_STRETCH) & (variance > LEAST_VARIANCE) & (variance < MOST_VARIANCE)
    if not known.any():
        return None
    weight = np.where(known, 1.0 / np.where(known, variance, 1.0), 0.0)
    local, local_mm2 = _averaged(np.where(known, share, 0.0), weight, rows, columns)
    mean, mean_variance = float(np.average(share[known], weights=weight[known])), 1.0 / float(weight.sum())
    # What places differ by beyond noise (moment estimator; DerSimonian and Laird, Controlled Clinical Trials 7, 177)
    places = max(float(np.average((local - mean) ** 2 - local_mm2, weights=weight)), 0.0)
    kept = places / (places + local_mm2)
    # Other pieces of the material differ from the one measured; what the scan cannot tell stays as it was there.
    told = terms.piece_sd**2 / (terms.piece_sd**2 + mean_variance + RADAR_SD**2)
    scan = 1.0 + told * (mean - 1.0)
    bias, spread = _bias_of(scan + kept * (local - mean), kept * local_mm2 + RADAR_SD**2, terms)
    off = np.log(np.maximum(bias, LEAST) / max(scan, LEAST) ** terms.power) / terms.power
    law = terms.power_sd * off * bias
    return Unstretched(
        change_mm=terms.bias_mm * (1.0 - bias),
        variance_mm2=terms.bias_mm**2 * (spread + law**2),
        stretch=scan,
        stretch_sd=float(np.sqrt(told * (mean_variance + RADAR_SD**2))),
        sd_mm=_common_mm(terms, scan, told, mean_variance),
        place_variance_mm2=(terms.place_sd_mm * bias) ** 2,
    )


def _common_mm(terms: StretchTerms, scan: float, told: float, mean_variance: float) -> float:
    """Return the standard deviation of the range error that all points share."""
    size = max(scan, LEAST)
    bias_mm = terms.bias_mm * size**terms.power
    of_law = told * np.hypot(terms.law_sd, terms.power_sd * np.log(size))
    of_stretch = terms.power / size * np.sqrt(told * (mean_variance + RADAR_SD**2))
    return float(np.sqrt(terms.rest_mm**2 + bias_mm**2 * (of_law**2 + of_stretch**2)))


def _bias_of(stretch: FloatArray, variance: FloatArray, terms: StretchTerms) -> tuple[FloatArray, FloatArray]:
    """Return the bias, over that of the piece, that echoes of a stretch (N,) have, and its variance.

    The power rises steeply at 0, so noise there must not pass for light inside: the mean is taken over all biases that
    agree with the stretch, none at all being as likely as all others together.
    """
    grid = SHARES ** (1.0 / terms.power)
    sd = np.sqrt(np.maximum(variance, (terms.power * 1e-3) ** 2))
    prior = np.full(len(grid), (1.0 - OPAQUE) / len(grid))
    prior[0] += OPAQUE
    found = np.empty((2, len(stretch)))
    for k in range(0, len(stretch), 4096):
        part = slice(k, k + 4096)
        off = (stretch[part, None] - grid) / sd[part, None]
        chance = prior * np.exp(-0.5 * (off**2 - np.min(off**2, axis=1, keepdims=True)))
        chance /= chance.sum(axis=1, keepdims=True)
        found[0, part] = chance @ SHARES
        found[1, part] = np.einsum("ng,ng->n", chance, (SHARES - found[0, part, None]) ** 2)
    return found[0], found[1]


def _averaged(
    share: FloatArray, weight: FloatArray, rows: IntArray, columns: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Average over growing neighbourhoods as far as they are alike; returns means (N,) and variances.

    Adaptive weights (Polzehl and Spokoiny, J. Royal Statistical Society B 62 (2000) 335): a neighbour counts the less
    the more its own value differs, by the noise of what the smaller neighbourhood gave.
    """
    row, column = rows.astype(np.int64) - rows.min(), columns.astype(np.int64) - columns.min()
    shape = int(row.max()) + 1, int(column.max()) + 1
    if shape[0] * shape[1] > MOST_CELLS * len(share):
        return np.full(len(share), share @ weight / weight.sum()), np.full(len(share), 1.0 / weight.sum())
    raw, own = np.zeros(shape), np.zeros(shape)
    raw[row, column], own[row, column] = share, weight
    mean, sure = _medians(raw, own)
    for radius in RADII:
        reach = int(radius)
        total, sums, squares = np.zeros((3, *shape))
        for down in range(-min(reach, shape[0] - 1), min(reach, shape[0] - 1) + 1):
            for right in range(-min(reach, shape[1] - 1), min(reach, shape[1] - 1) + 1):
                near = 1.0 - (down**2 + right**2) / radius**2
                if near <= 0:
                    continue
                here, there = _overlap(shape[0], down), _overlap(shape[1], right)
                at, other = (here[0], there[0]), (here[1], there[1])
                unlike = (mean[at] - mean[other]) ** 2 * np.minimum(sure[at], sure[other]) / ALIKE
                alike = near * np.maximum(1.0 - unlike, 0.0)
                total[at] += alike * own[other]
                sums[at] += alike * own[other] * raw[other]
                squares[at] += alike**2 * own[other]
        some = total > 0
        mean = np.where(some, sums / np.where(some, total, 1.0), 0.0)
        sure = np.where(some, total**2 / np.where(some, squares, 1.0), 0.0)
    nothing = 1.0 / max(float(sure.max()), 1e-300) * 1e6  # far from every echo that tells
    variance = np.where(sure > 0, 1.0 / np.where(sure > 0, sure, 1.0), nothing)
    return mean[row, column], variance[row, column]


def _medians(raw: FloatArray, own: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the medians of the first neighbours of each cell, and the inverse of their variance."""
    reach = FIRST
    values = np.pad(np.where(own > 0, raw, np.nan), reach, constant_values=np.nan)
    weights = np.pad(own, reach)
    size = 2 * reach + 1
    around = np.lib.stride_tricks.sliding_window_view(values, (size, size)).reshape(*raw.shape, -1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # no neighbour that tells: NaN
        medians = np.nan_to_num(np.nanmedian(around, axis=2))
    sure = np.lib.stride_tricks.sliding_window_view(weights, (size, size)).sum(axis=(2, 3)) / MEDIAN_VARIANCE
    return np.asarray(medians, dtype=np.float64), np.asarray(sure, dtype=np.float64)


def _overlap(size: int, by: int) -> tuple[slice, slice]:
    """Return where places lie that have a neighbour so many steps on, and where these neighbours lie."""
    return slice(max(0, -by), size - max(0, by)), slice(max(0, by), size - max(0, -by))
