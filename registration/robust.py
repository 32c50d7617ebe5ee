"""The robust method: search, then an exact finish.

(1) The socket's centre from a consensus over spheres, (2) rotations from a low-discrepancy sequence, (3) races of
damped Gauss-Newton steps under a one-sided loss on distance fields, (4) distinct finishers polished with tissue decided
over neighbourhoods and ranked by likelihood, (5) symmetric steps on exact closest points with the noise they show.
"""

from __future__ import annotations

import numpy as np

from registration._types import FloatArray, IntArray
from registration.assess import Solution
from registration.exclusion import outside_regions
from registration.finish import exact_finish
from registration.model import Model
from registration.noise import TYPICAL_RANGE_MM, NoiseModel
from registration.result import Rival
from registration.rigid import transform
from registration.scan import Scan
from registration.search import SURE_HITS, Search, difference
from registration.tissue import neighbours, raster_noise

MAX_RIVALS = 5
"""Rivals reported at most."""


def register_robust(
    scan: Scan, model: Model, start: FloatArray | None, noise_mm: float | None, regions: FloatArray
) -> Solution:
    """Register a scan to a model.

    Parameters
    ----------
    scan : Scan
    model : Model
    start : (4, 4) array or None
        None searches from anywhere.
    noise_mm : float or None
        Range noise; estimated when None.
    regions : (K, 4) array
        Excluded spheres of the model, centre and radius.
    """
    around = neighbours(scan)
    sigma = initial_noise(scan, around, noise_mm)
    search = Search(scan, around, model, sigma)
    candidates = search.from_anywhere() if start is None else search.about(start)
    best = candidates[0].model_from_scanner
    allowed = outside_regions(transform(best, scan.points), regions)
    known = noise_mm is not None or scan.covariance is not None
    final = exact_finish(scan, model.surface, best, NoiseModel(sigma), around, allowed, noise_known=known)
    return Solution(
        model_from_scanner=final.model_from_scanner,
        closest=final.met,
        inliers=final.inliers,
        history=final.history,
        rivals=[
            Rival(c.model_from_scanner, -c.log_likelihood, *difference(c.model_from_scanner, best, search.middle))
            for c in candidates[1 : MAX_RIVALS + 1]
        ],
        noise=final.noise,
        around=around,
        cost=-candidates[0].log_likelihood,
        method="robust",
        sure=start is not None or candidates[0].hits >= SURE_HITS,
    )


def initial_noise(scan: Scan, around: IntArray, noise_mm: float | None) -> float:
    """Noise along the beam to search with: given, from the covariances, or from the raster itself."""
    if noise_mm is not None:
        return noise_mm
    if scan.covariance is not None:
        return float(np.sqrt(np.median(np.einsum("ni,nij,nj->n", scan.beams, scan.covariance, scan.beams))))
    found = raster_noise(scan, around)
    return float(np.clip(0.65 * found, 0.1, 2.0)) if np.isfinite(found) else TYPICAL_RANGE_MM
