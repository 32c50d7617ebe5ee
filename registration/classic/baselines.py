"""Named methods of the literature, for comparison with the robust solver; all are local and need a start.

References
----------
Chen, Medioni, IVC 10:145 (1992): point-to-plane ICP. Fitzgibbon, IVC 21:1145 (2003): LM-ICP on a distance map.
Pelizzari et al., J. Comput. Assist. Tomogr. 13:20 (1989): head and hat.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.classic.losses import Loss
from picoradar.registration.least_squares import Damping, minimised, plane_rows
from picoradar.registration.model import Closest, DistanceField, Surface
from picoradar.registration.se3 import small_motion, transform

DAMPING = Damping(first=1e-3, smallest=1e-9, ridge=1e-9)
"""Of the Levenberg-Marquardt steps."""

SETTLED_RAD, SETTLED_MM = 1e-7, 1e-6
"""A smaller step is the last one."""

HAT_REACH_RAD, HAT_REACH_MM = float(np.radians(20.0)), 20.0
"""How far Powell's line searches may go from the start; without bounds their first brackets leave the head."""


def plane_icp(
    points: FloatArray, surface: Surface, start: FloatArray, loss: Loss, *, max_iterations: int = 60
) -> FloatArray:
    """Point-to-plane ICP under any robust criterion, by Levenberg-Marquardt steps.

    Without damping the steps circle: a socket that is nearly a sphere hardly holds its rotations.

    Parameters
    ----------
    points : (N, 3) array
        Scanner frame, mm.
    surface : Surface
    start : (4, 4) array
        `model_from_scanner`.
    loss : Loss
        One of :data:`picoradar.registration.classic.losses.LOSSES`, or another.
    max_iterations : int

    Returns
    -------
    (4, 4) array
        `model_from_scanner`.
    """

    def factor_at(solution: FloatArray) -> _PlaneFactor:
        moved = transform(solution, points)
        return _PlaneFactor(solution, moved, surface.closest(moved), loss)

    def settled(x: FloatArray) -> bool:
        return bool(np.linalg.norm(x[:3]) < SETTLED_RAD and np.linalg.norm(x[3:]) < SETTLED_MM)

    def kept(here: _PlaneFactor, ahead: _PlaneFactor) -> bool:
        residuals, residuals_ahead = here.closest.signed_mm, ahead.closest.signed_mm
        return bool(here.weights @ residuals_ahead**2 <= here.weights @ residuals**2)

    return minimised(factor_at, start, settled=settled, max_steps=max_iterations, damping=DAMPING, kept=kept)


@dataclass(frozen=True)
class _PlaneFactor:
    """Weighted squared distances to the planes of the closest points, about one pose."""

    pose: FloatArray
    moved: FloatArray
    closest: Closest
    loss: Loss

    @cached_property
    def centre(self) -> FloatArray:
        """Mean (3,) of the points."""
        return np.asarray(self.moved.mean(axis=0), dtype=np.float64)

    @cached_property
    def weights(self) -> FloatArray:
        """Weights (N,) of the squared residuals."""
        return self.loss.weights(self.closest.signed_mm)

    def normal_equations(self) -> tuple[FloatArray, FloatArray]:
        """H (6, 6) and g (6,)."""
        rows = plane_rows(self.moved, self.closest.normals, self.centre)
        return (rows * self.weights[:, None]).T @ rows, rows.T @ (self.weights * self.closest.signed_mm)


def lm_icp(points: FloatArray, field: DistanceField, start: FloatArray, *, huber_mm: float = 1.0) -> FloatArray:
    """LM-ICP: Levenberg-Marquardt on a distance field in the model frame with a Huber loss.

    Parameters
    ----------
    points : (N, 3) array
        Scanner frame, mm.
    field : DistanceField
        In the model frame.
    start : (4, 4) array
    huber_mm : float
        Where the loss turns linear.

    Returns
    -------
    (4, 4) array
        `model_from_scanner`.
    """
    from scipy.optimize import least_squares

    base = transform(start, points)
    centre = np.asarray(base.mean(axis=0), dtype=np.float64)

    def sampled(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        moved = transform(small_motion(x, centre), base)
        distance, gradient = field.sample(np.ascontiguousarray(moved.T, dtype=np.float32))
        return moved, distance.astype(np.float64), gradient.astype(np.float64)

    def residuals(x: FloatArray) -> FloatArray:
        return sampled(x)[1]

    def jacobian(x: FloatArray) -> FloatArray:
        moved, _, gradient = sampled(x)
        return plane_rows(moved, gradient, centre + x[3:])

    found = least_squares(residuals, np.zeros(6), jac=jacobian, loss="huber", f_scale=huber_mm, x_scale="jac")
    return small_motion(np.asarray(found.x, dtype=np.float64), centre) @ start


def head_and_hat(points: FloatArray, surface: Surface, start: FloatArray, centre: FloatArray) -> FloatArray:
    """Head and hat: Powell's search on the distances along the rays from `centre` through the points to the surface.

    Parameters
    ----------
    points : (N, 3) array
        The hat, scanner frame, mm.
    surface : Surface
        The head, or any surface that `centre` sees (a socket from its middle).
    start : (4, 4) array
    centre : (3,) array
        Model frame, mm. Points whose rays meet nothing, as beyond the rim of a socket, count by their distance to the
        closest surface: left out, they would draw the hat off the head.

    Returns
    -------
    (4, 4) array
        `model_from_scanner`.
    """
    from scipy.optimize import minimize

    base = transform(start, points)
    radius = float(np.linalg.norm(base - centre, axis=1).mean())

    def cost(x: FloatArray) -> float:
        moved = transform(small_motion(np.concatenate([x[:3] / radius, x[3:]]), centre), base)
        length = np.linalg.norm(moved - centre, axis=1)
        hit = surface.first_hit(np.broadcast_to(centre, moved.shape), (moved - centre) / length[:, None])
        distance = np.subtract(hit, length, out=np.zeros_like(hit), where=np.isfinite(hit))
        missed = ~np.isfinite(hit)
        if missed.any():
            distance[missed] = surface.distances(moved[missed])
        return float(np.mean(distance**2))

    reach = [HAT_REACH_RAD * radius] * 3 + [HAT_REACH_MM] * 3
    bounds = [(-r, r) for r in reach]
    found = minimize(cost, np.zeros(6), method="Powell", bounds=bounds, options={"xtol": 1e-4, "ftol": 1e-8})
    x = np.asarray(found.x, dtype=np.float64)
    return small_motion(np.concatenate([x[:3] / radius, x[3:]]), centre) @ start
