"""Is there a second pulse in a piece that was fitted with one?

A second surface adds a copy of the pulse, earlier or later. What a fit of one pulse leaves of such a copy is known, and
the residuals are compared with it: a positive share that stands out of the noise is evidence (a score test). Copies
that are nearer than a few centimetres all look alike: they broaden the pulse.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import ShapeTable
from picoradar.instrument.ranging.template_fit import Residuals

FloatArray = NDArray[np.float64]


LEAST_LEFT = 0.01  # of a copy: less is rounding of the table
LEAST_NOISE = 1e-6  # of a copy of which nothing is left


class Evidence(NamedTuple):
    """Standard deviations by which the share of a copy stands out of the noise: of ``near`` copies, which broaden the
    pulse, and of any farther one (R,)."""

    near: FloatArray
    far: FloatArray


def evidence(left: Residuals, covariance: FloatArray, settings: RangingSettings) -> Evidence:
    """Look for a second pulse in residuals (R, M) whose deviations have this covariance (M, M).

    Pulses whose places differ by less than `settings.probe_grid_ps` share their copies.
    """
    records, samples = left.deviations.shape
    scores = np.empty((records, 2 * len(settings.probes_ps)))
    grid = max(1, round(settings.probe_grid_ps / left.table.step_ps * left.table.phases))
    places = left.table.places(left.entries.first)
    for place in np.unique(places // grid):
        these = np.flatnonzero(places // grid == place)
        first = int(left.entries.first[these[len(these) // 2]])
        copies = _copies(left.table, first, samples, settings.probes_ps)
        noise = np.sqrt(np.maximum(np.einsum("mk,mn,nk->k", copies, covariance, copies, optimize=True), LEAST_NOISE))
        scores[these] = left.deviations[these] @ copies / noise
    near = 2 * settings.near_probes
    return Evidence(scores[:, :near].mean(axis=1), scores[:, near:].max(axis=1))


@lru_cache(maxsize=1024)
def _copies(table: ShapeTable, first: int, samples: int, probes_ps: tuple[float, ...]) -> FloatArray:
    """Return what fits leave of copies (M, 2 P), of unit length; zeros for one that leaves next to nothing."""
    at = np.array([first])
    root = np.sqrt(table.weights(at, samples)[0])
    design, _ = np.linalg.qr((table.design(at, samples)[:, 0] * root).T)
    copies = np.empty((samples, 2 * len(probes_ps)))
    for k, probe_ps in enumerate(probes_ps):
        for sign, column in ((1, 2 * k), (-1, 2 * k + 1)):
            copy = table.shifted(first, samples, sign * probe_ps) * root
            left = copy - design @ (design.T @ copy)
            length, whole = float(np.linalg.norm(left)), float(np.linalg.norm(copy))
            copies[:, column] = left / length if length > LEAST_LEFT * max(whole, 1e-300) else 0.0
    return copies
