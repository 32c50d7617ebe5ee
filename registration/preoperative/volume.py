"""Surface points of a CT volume: a threshold from two Gaussians, and the places where the intensity crosses it.

So that preoperative points, too, can be registered against a model's distance field.

References
----------
Registration of post-build CT to laser scan vectors, section 3.3.2: intensities as a mixture of two normal
distributions, fitted by expectation maximisation; the threshold lies where part and surroundings are equally
probable, and the part's outermost voxels are the surface. Here it is interpolated between two voxels, and the
threshold may lie halfway.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import PointsError

TINY = 1e-300
"""Added to a density, whose logarithm or quotient is taken."""

BINS = 512
"""Of the histogram that the mixture is fitted to."""

MAX_ROUNDS, SETTLED_SHARE = 200, 1e-3
"""Rounds of expectation maximisation at most, and the motion of the means, in bins, that ends them."""


@dataclass(frozen=True)
class TwoGaussians:
    """Two normal distributions, the darker first.

    Attributes
    ----------
    share, mean, sd : (2,) arrays
        Of the voxels; means and deviations in units of the intensity.
    """

    share: FloatArray
    mean: FloatArray
    sd: FloatArray

    def densities(self, values: FloatArray) -> FloatArray:
        """Weighted densities (N, 2) at intensities (N,)."""
        z = (values[:, None] - self.mean) / self.sd
        return np.asarray(self.share * np.exp(-0.5 * z * z) / (self.sd * np.sqrt(2.0 * np.pi)), dtype=np.float64)

    @property
    def equally_probable(self) -> float:
        """Intensity between the means where both are equally probable: the threshold of the source."""
        between = np.linspace(self.mean[0], self.mean[1], 1001)
        dark, bright = self.densities(between).T
        return float(between[int(np.argmin(np.abs(np.log(dark + TINY) - np.log(bright + TINY))))])

    @property
    def halfway(self) -> float:
        """Intensity of a voxel that is filled to one half: where the surface is, whatever the shares and deviations."""
        return float(self.mean.mean())


def two_gaussians(values: npt.ArrayLike) -> TwoGaussians:
    """Fit a mixture of two normal distributions to intensities (N,) by expectation maximisation on their histogram.

    Raises
    ------
    PointsError
        For values that are not finite or do not vary.
    """
    data = np.asarray(values, dtype=np.float64).ravel()
    if data.size < 2 or not np.isfinite(data).all() or np.ptp(data) == 0.0:
        raise PointsError("the intensities are not finite or all the same: there is no part and no background in them")
    count, edges = np.histogram(data, bins=BINS)
    middle = (edges[1:] + edges[:-1]) / 2.0
    split = float(data.mean())
    low, high = data[data <= split], data[data > split]
    smallest_sd = float(edges[1] - edges[0])
    found = TwoGaussians(
        share=np.array([low.size, high.size]) / data.size,
        mean=np.array([low.mean(), high.mean()]),
        sd=np.maximum([low.std(), high.std()], smallest_sd),
    )
    for _ in range(MAX_ROUNDS):
        density = found.densities(middle)
        weight = count[:, None] * density / np.maximum(density.sum(axis=1, keepdims=True), TINY)
        total = weight.sum(axis=0)
        mean = middle @ weight / total
        variance = ((middle[:, None] - mean) ** 2 * weight).sum(axis=0) / total
        moved = float(np.abs(mean - found.mean).max())
        found = TwoGaussians(total / data.size, mean, np.maximum(np.sqrt(variance), smallest_sd))
        if moved < SETTLED_SHARE * smallest_sd:
            break
    return found


def surface_points(volume: npt.ArrayLike, affine: npt.ArrayLike, threshold: float | None = None) -> FloatArray:
    """Points where the intensity crosses the threshold between two neighbouring voxels.

    Parameters
    ----------
    volume : (I, J, K) array
        Intensities.
    affine : (4, 4) array
        From voxel indices to mm, as a NIfTI file gives it.
    threshold : float, optional
        Halfway between two Gaussians of the whole volume when not given. (Where they are equally probable, which
        rates voxels, not places, the surface of a made-up CT with voxels of 1.5 mm lies 0.4 mm outside the true one.)

    Returns
    -------
    (N, 3) array
        mm.

    Raises
    ------
    PointsError
        For a volume that is not three-dimensional and finite, or that nothing crosses.
    """
    data = np.asarray(volume, dtype=np.float64)
    if data.ndim != 3 or not np.isfinite(data).all():
        raise PointsError(f"the volume has shape {data.shape}: give a finite three-dimensional array")
    level = two_gaussians(data).halfway if threshold is None else threshold
    part = data >= level
    found = []
    for axis in range(3):
        here, there = (tuple(slice(k, k - 1 or None) if a == axis else slice(None) for a in range(3)) for k in (0, 1))
        index = np.argwhere(part[here] != part[there])
        first, second = data[here][tuple(index.T)], data[there][tuple(index.T)]
        place = index.astype(np.float64)
        place[:, axis] += (level - first) / (second - first)
        found.append(place)
    places = np.concatenate(found)
    if len(places) == 0:
        raise PointsError(f"nothing in the volume crosses the threshold {level:.4g}")
    matrix = np.asarray(affine, dtype=np.float64)
    return np.asarray(places @ matrix[:3, :3].T + matrix[:3, 3], dtype=np.float64)
