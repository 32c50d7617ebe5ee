"""Principal curvatures of a surface, for those who choose points or judge a model: the solvers do not use them.

Reference: Panozzo, Puppo, Rocca, "Efficient multi-scale curvature and crease estimation" (2010), as in libigl.
"""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.model.surface import Surface


def principal_curvatures(surface: Surface) -> FloatArray:
    """Largest and smallest curvature (V, 2) in 1/mm at each vertex, positive where the surface bulges outward.

    From quadrics fitted to the neighbourhoods of five rings. NaN at vertices whose surroundings fix no quadric.
    """
    import igl

    _, _, largest, smallest, failed = igl.principal_curvature(surface.vertices, surface.faces)
    found = np.stack([largest, smallest], axis=1)
    found[np.asarray(failed, dtype=np.int64)] = np.nan
    return np.asarray(found, dtype=np.float64)
