"""What the pulses of many records have in common that the calibration does not have: another shape.

Where the mean residual of many records stands out of the noise, the shape of the pulse has changed, or something that
is in step with the trigger is added to it. A change that the reference shows, too, moves both pulses alike and cancels;
only what the echo shows beyond it can move a range. By how much cannot be told from the residuals, because a fit takes
up just that part of a change which moves the pulse. It is taken to be as large as the part that is left would
be, if the whole were a smooth random curve.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import ShapeTable
from picoradar.instrument.ranging.template_fit import UNKNOWNS, PulseFit, Residuals

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class CommonShape(NamedTuple):
    """A change of shape: ``share`` (M,) of the amplitude, ``after_ps`` (M,) the 50 % point of the pulse."""

    after_ps: FloatArray
    share: FloatArray

    @property
    def rms(self) -> float:
        """Get the root mean square of the share."""
        return float(np.sqrt(np.mean(self.share**2)))

    def at(self, after_ps: FloatArray) -> FloatArray:
        """Return it at other times, 0 beyond its ends."""
        return np.asarray(np.interp(after_ps, self.after_ps, self.share, left=0.0, right=0.0), dtype=np.float64)


def usable_records(fit: PulseFit, left: Residuals, settings: RangingSettings) -> BoolArray:
    """Return which records (R,) have a pulse of the shape that most have."""
    square = left.square / left.used.sum(axis=1)
    usable = np.isfinite(square) & (fit.amplitude_mv > settings.min_response_mv)
    if usable.any():
        usable &= square <= settings.max_pooled_misfit * max(float(np.median(square[usable])), 1.0)
    return np.asarray(usable, dtype=np.bool_)


def common_shape(fit: PulseFit, settings: RangingSettings) -> CommonShape | None:
    """Find the change of shape that the records of one group have in common, if there is one.

    Parameters
    ----------
    fit : PulseFit
        Of pieces of one form, that were cut in the same way.
    settings : RangingSettings
    """
    left = fit.residuals
    if left is None:
        return None
    usable = usable_records(fit, left, settings)
    if usable.sum() < settings.min_common:
        return None
    every = bool(usable.all())
    deviations = left.deviations if every else left.deviations[usable]
    mean = deviations.mean(axis=0)
    samples = len(mean)
    spread = np.maximum(np.einsum("rm,rm->m", deviations, deviations) / len(deviations) - mean**2, 1.0)
    freedom = samples - UNKNOWNS
    if usable.sum() * np.sum(mean**2 / spread) < freedom + settings.common_sigmas * np.sqrt(2.0 * freedom):
        return None
    scale = np.sqrt(left.table.weights(left.entries.first[usable], samples) * left.sweeps[usable, None])
    shares = deviations / scale / fit.amplitude_mv[usable, None]
    step = left.table.step_ps
    after = np.arange(samples) * step - fit.delay_ps[usable][:, None]
    bins = np.rint((after - after.min()) / step).astype(np.int64).ravel()
    count = np.bincount(bins)
    some = count >= settings.min_common / 2
    centre, share = (np.bincount(bins, values.ravel())[some] / count[some] for values in (after, shares))
    return CommonShape(centre, share)


def without(fit: PulseFit, shape: CommonShape | None) -> PulseFit:
    """Return a fit whose residuals do not show a change of shape."""
    left = fit.residuals
    if shape is None or left is None:
        return fit
    samples = left.deviations.shape[1]
    after: FloatArray = np.arange(samples) * left.table.step_ps - fit.delay_ps[:, None]
    weight = left.table.weights(left.entries.first, samples) * left.sweeps[:, None]
    shares = shape.at(np.asarray(after, dtype=np.float64))
    modelled = np.sqrt(weight) * fit.amplitude_mv[:, None] * _left_by_fit(left, shares)
    return fit._replace(residuals=left._replace(deviations=np.where(left.used, left.deviations - modelled, 0.0)))


def moved_sd_ps(fit: PulseFit, shape: CommonShape, settings: RangingSettings) -> float:
    """Return by how much (standard deviation) a change of shape may move the pulses of a group."""
    left = fit.residuals
    if left is None:
        return 0.0
    samples = left.deviations.shape[1]
    after = np.asarray(np.arange(samples) * left.table.step_ps - float(np.median(fit.delay_ps)), dtype=np.float64)
    share = _left_by_fit(left, shape.at(after))
    width = max(1, round(settings.common_local_ps / left.table.step_ps))
    size = np.sqrt(uniform_filter1d(share**2, width, mode="nearest"))
    rate = np.gradient(share, left.table.step_ps)
    length_ps = settings.common_smoother * np.sqrt(np.sum(share**2) / max(np.sum(rate**2), 1e-300))
    apart = np.subtract.outer(after, after) / max(length_ps, left.table.step_ps)
    curves = size[:, None] * np.exp(-0.5 * apart**2) * size
    design, gain = _usual(left)
    rest = np.eye(samples) - design.T @ gain
    seen = np.einsum("ij,jk,ik->", rest, curves, rest, optimize=True)  # of such curves, what fits leave
    pulled = gain[0] * float(np.median(left.entries.amplitude_mv))
    return float(np.sqrt(max(pulled @ curves @ pulled, 0.0) * np.sum(share**2) / max(seen, 1e-300)))


def _usual(left: Residuals) -> tuple[FloatArray, FloatArray]:
    """Return derivatives (3, M) of the usual record of a group, and what its fit takes up (3, M) of a change in mV."""
    return usual_gain(left.table, left.usual[0], left.deviations.shape[1])


@lru_cache(maxsize=1024)
def usual_gain(table: ShapeTable, first: int, samples: int) -> tuple[FloatArray, FloatArray]:
    """Return derivatives (3, M) of the piece at an entry, and what its fit takes up (3, M) of a change in mV."""
    at = np.array([first])
    design, weight = table.design(at, samples)[:, 0], table.weights(at, samples)[0]
    return design, np.linalg.pinv((design * weight) @ design.T, hermitian=True) @ (design * weight)


def _left_by_fit(left: Residuals, curve: FloatArray) -> FloatArray:
    """Return what a fit leaves of curves (..., M)."""
    design, gain = _usual(left)
    return np.asarray(curve - (curve @ gain.T) @ design, dtype=np.float64)
