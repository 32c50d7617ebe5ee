"""Iterative closest points after Besl and McKay, as section 3.3.1 of the dissertation uses it.

References
----------
Besl, McKay, PAMI 14:239 (1992). Dissertation, sections 3.3.1 and 3.3.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.classic.acceleration import Accelerator
from picoradar.registration.model import Surface
from picoradar.registration.paired_points import horn
from picoradar.registration.se3 import transform
from picoradar.registration.solution import Iteration, residual_measures


@dataclass(frozen=True)
class IcpResult:
    """Pose (4, 4) `model_from_scanner`, distances (N,) mm at that pose, and how it got there."""

    model_from_scanner: FloatArray
    distances_mm: FloatArray
    converged: bool
    history: list[Iteration] = field(default_factory=list)


def icp(
    points: FloatArray,
    surface: Surface,
    start: FloatArray,
    *,
    max_iterations: int = 40,
    tolerance_mm2: float = 1e-9,
    accelerated: bool = False,
    stage: str = "icp",
) -> IcpResult:
    """Alternate closest points and Horn's closed form until the mean square distance stops improving.

    The mean square distance falls in every iteration (Besl and McKay's theorem), so the last pose is the best.

    Parameters
    ----------
    points : (N, 3) array
        Scanner frame, mm.
    surface : Surface
    start : (4, 4) array
        `model_from_scanner` to start from.
    max_iterations : int
    tolerance_mm2 : float
        Stop when the mean square distance falls by less than this.
    accelerated : bool
        Jump ahead where steps keep their direction; a jump that raises the error is taken back.
    stage : str
        Name for the history.
    """
    solution, previous, converged = start, np.inf, False
    centre = np.asarray(points.mean(axis=0), dtype=np.float64)
    monitor = Accelerator(centre, float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean())))
    history: list[Iteration] = []
    closest = surface.closest(transform(solution, points))
    for _ in range(max_iterations):
        measures = residual_measures(closest.signed_mm)
        history.append(Iteration(stage, measures.rms_mm, measures.mean_mm, measures.max_mm, len(points)))
        if previous - measures.nlse < tolerance_mm2:
            converged = True
            break
        previous = measures.nlse
        solution = horn(closest.points, points)
        closest = surface.closest(transform(solution, points))
        if accelerated:
            monitor.add(solution, float(np.mean(closest.signed_mm**2)))
            jump = monitor.proposal()
            if jump is not None:
                ahead = surface.closest(transform(jump, points))
                if np.mean(ahead.signed_mm**2) < monitor.errors[-1]:
                    solution, closest = jump, ahead
                    monitor.add(solution, float(np.mean(ahead.signed_mm**2)))
                monitor.forget()
    return IcpResult(solution, np.abs(closest.signed_mm), converged, history)
