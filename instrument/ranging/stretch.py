"""How far light that has entered the target stretches each echo, from what the fit of the calibration's pulse leaves.

The calibration knows the pattern that a fit leaves of one piece of the material (`Stretch`). The share of it in the
residuals of a record, by weighted least squares, is the stretch of that record: 0 on paint, 1 on the piece. A piece of
trace of any length shows its part of the pattern: the fit takes up of it what looks like delay, amplitude and baseline.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Stretch
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.template_fit import UNKNOWNS, PulseFit, Residuals

FloatArray = NDArray[np.float64]

LEAST_SEEN = 1e-12  # of a pattern in standard deviations, squared: where nothing of it is seen, its variance is finite


class Stretched(NamedTuple):
    """Stretch (R,) of R echoes and its variance (R,), as calibrated noise makes it."""

    share: FloatArray
    variance: FloatArray

    @classmethod
    def unknown(cls, records: int) -> Stretched:
        return cls(np.full(records, np.nan), np.full(records, np.nan))

    @classmethod
    def joined(cls, parts: Sequence[Stretched | None]) -> Stretched | None:
        """Put several groups of records one after the other; None where it was not asked for."""
        found = [part for part in parts if part is not None]
        return cls(*map(np.concatenate, zip(*found, strict=True))) if found else None

    def taken(self, records: NDArray[np.intp]) -> Stretched:
        """Return some of the records, in the order asked for."""
        return Stretched(self.share[records], self.variance[records])


def stretch_in(fit: PulseFit, pattern: Stretch, settings: RangingSettings) -> tuple[Stretched, PulseFit]:
    """Find the stretch of each echo; also return the fit without it in its residuals.

    What is taken from the residuals of a record is the median stretch of its neighbours on the side that is more like
    it: a record that differs from all around it, as one that has two surfaces in its spot, goes on showing it.

    Parameters
    ----------
    fit : PulseFit
        Of R records, neighbours in their order.
    pattern : Stretch
    settings : RangingSettings
    """
    left = fit.residuals
    if left is None:
        return Stretched.unknown(len(fit.delay_ps)), fit
    of_one = _deviations(fit, left, pattern)
    seen = np.maximum(np.einsum("rm,rm->r", of_one, of_one), LEAST_SEEN)
    share = np.nan_to_num(np.einsum("rm,rm->r", of_one, left.deviations) / seen)
    around = np.clip(_of_neighbours(share, settings.stretch_neighbours), 0.0, settings.largest_stretch)
    deviations = np.where(left.used, left.deviations - around[:, None] * of_one, 0.0)
    return Stretched(share, 1.0 / seen), fit._replace(residuals=left._replace(deviations=deviations))


def _deviations(fit: PulseFit, left: Residuals, pattern: Stretch) -> FloatArray:
    """Return what fits leave (R, M) of a stretch of 1, in standard deviations of the calibrated noise."""
    samples = left.deviations.shape[1]
    after = np.arange(samples) * left.table.step_ps - fit.delay_ps[:, None]
    known = pattern.start_ps + pattern.step_ps * np.arange(len(pattern.share))
    share = np.interp(after, known, pattern.share, left=0.0, right=0.0)
    root = np.sqrt(left.table.weights(left.entries.first, samples) * left.sweeps[:, None]) * left.used
    whole = root * np.maximum(fit.amplitude_mv, 0.0)[:, None] * share
    design = left.table.design(left.entries.first, samples) * root  # (3, R, M)
    normal = np.einsum("irm,jrm->rij", design, design) + np.eye(UNKNOWNS) * LEAST_SEEN
    taken_up = np.linalg.solve(normal, np.einsum("irm,rm->ri", design, whole)[:, :, None])[:, :, 0]
    return np.asarray(whole - np.einsum("ri,irm->rm", taken_up, design), dtype=np.float64)


def _of_neighbours(share: FloatArray, reach: int) -> FloatArray:
    """Return, of the medians of the neighbours before and behind each record, the one that is nearer to its own."""
    padded = np.pad(share, reach, constant_values=np.nan)
    runs = np.lib.stride_tricks.sliding_window_view(padded, reach)  # (R + reach + 1, reach)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # no neighbour on a side: NaN
        sides = np.nanmedian(np.stack([runs[: len(share)], runs[reach + 1 :]]), axis=2)
    apart = np.where(np.isnan(sides), np.inf, np.abs(sides - share))
    nearer = np.take_along_axis(sides, np.argmin(apart, axis=0)[None], axis=0)[0]
    return np.where(np.isnan(nearer), share, nearer)
