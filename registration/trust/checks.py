"""What speaks for or against a pose beside its predicted error: halves, whiteness, coverage, light, share of biases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.least_squares import weighted_squares
from picoradar.registration.scan import Scan
from picoradar.registration.solution import Solution
from picoradar.registration.trust.budget import Socket
from picoradar.registration.trust.covariance import P95, Target, chi_square_quantile
from picoradar.registration.trust.evidence import Tolerance
from picoradar.registration.trust.fit import Assessed

LEAST_RESPONSE_QUANTILE = 0.05
"""Of the points taken for bone, the response that 5 % fall short of."""

CELL_DEG, SOCKET_REACH = 10.0, 1.35
"""Size of the patches of a socket that count as seen or not, and the distance from its centre, in radii, within which
the model's vertices belong to it."""


@dataclass(frozen=True)
class Checks:
    """Figures of the judgement, for whoever wants to see what it rests on.

    Attributes
    ----------
    halves : float
        How far the poses of two halves of the points, cut across their longest side, are apart: in shares of what
        noise allows in 95 % of all cases.
    halves_deg, halves_mm : float
        By how much: rotation, and shift at their centre.
    whiteness : float
        Correlation of a residual with those of its neighbours: noise has none.
    coverage_percent : float
        Share of the socket, where the model has one, that points taken for bone lie on; else of the points.
    least_response_mv : float
        Response that 5 % of the points taken for bone fall short of; NaN where none is known.
    bias_share : float
        Share of the stated error at the worst target that is no random one.
    """

    halves: float
    halves_deg: float
    halves_mm: float
    whiteness: float
    coverage_percent: float
    least_response_mv: float
    bias_share: float

    def halves_off(self, tolerance: Tolerance) -> float:
        """How far the poses of the halves are apart, as a share of what is allowed."""
        return max(self.halves_deg / tolerance.rotation_deg, self.halves_mm / tolerance.target_mm)


def checks_of(
    scan: Scan, solution: Solution, fit: Assessed, targets: Sequence[Target], sockets: Sequence[Socket]
) -> Checks:
    """Take all of them."""
    squares = float(np.mean(fit.points.residual[fit.points.used] ** 2))
    stated = max(targets, key=lambda t: t.stated_mm, default=None)
    light = None if scan.response_mv is None else scan.response_mv[fit.used]
    apart, halves = halves_apart(fit)
    return Checks(
        halves=halves,
        halves_deg=float(np.degrees(np.linalg.norm(apart[:3]))),
        halves_mm=float(np.linalg.norm(apart[3:])),
        whiteness=min(1.0, fit.misfit_mm**2 / max(squares, np.finfo(np.float64).tiny)),
        coverage_percent=100.0 * (socket_coverage(fit, sockets) if sockets else float(solution.inliers.mean())),
        least_response_mv=float("nan") if light is None else float(np.quantile(light, LEAST_RESPONSE_QUANTILE)),
        bias_share=float("nan") if stated is None else 1.0 - stated.p95_mm / max(stated.stated_mm, 1e-12),
    )


def halves_apart(fit: Assessed) -> tuple[FloatArray, float]:
    """Motion (6,) between the poses of two halves, and its size over its 95 % bound.

    Each half is solved on the tangent planes of the whole.

    Halves that share a wrong surface or tissue taken for bone want to go different ways; noise lets them differ by the
    sum of their covariances. Its scale is that of the whole, which holds what lines and patches share.
    """
    points = fit.points
    local = points.seen.places - points.seen.centre
    longest = np.linalg.eigh(local[points.used].T @ local[points.used])[1][:, -1]
    beyond = local @ longest > np.median(local[points.used] @ longest)
    weight = points.used / points.sigma**2
    moves, spreads = [], []
    for half in (beyond, ~beyond):
        inverse = np.linalg.pinv(weighted_squares(points.rows[half], weight[half]), hermitian=True)
        moves.append(inverse @ (points.rows[half].T @ (weight[half] * points.residual[half])))
        spreads.append(inverse)
    whole = np.linalg.pinv(weighted_squares(points.rows, weight), hermitian=True)
    inflation = float(np.trace(fit.own @ np.linalg.pinv(whole, hermitian=True))) / len(whole)
    apart, spread = moves[0] - moves[1], (spreads[0] + spreads[1]) * max(1.0, inflation)
    size = float(apart @ np.linalg.pinv(spread, hermitian=True) @ apart) / chi_square_quantile(6.0, P95)
    return apart, float(np.sqrt(max(0.0, size)))


def socket_coverage(fit: Assessed, sockets: Sequence[Socket]) -> float:
    """Share of the nearest socket's patches, as seen from its centre, that points taken for bone lie in."""
    socket = min(sockets, key=lambda one: float(np.linalg.norm(one.centre - fit.centre)))
    there = _patches(socket.vertices - socket.centre, socket)
    seen = _patches(fit.points.seen.places[fit.points.used] - socket.centre, socket)
    return len(there & seen) / len(there) if there else 0.0


def _patches(arms: FloatArray, socket: Socket) -> set[tuple[int, int]]:
    """Patches of about equal area that `arms` (N, 3) from the socket's centre point to, on its inner half."""
    reach = np.linalg.norm(arms, axis=1)
    depth = -(arms @ socket.axis) / np.maximum(reach, 1e-9)
    inner = (reach < SOCKET_REACH * socket.radius_mm) & (depth > 0.0)
    helper = np.eye(3)[int(np.argmin(np.abs(socket.axis)))]
    u = np.cross(socket.axis, helper)
    u /= np.linalg.norm(u)
    v = np.cross(socket.axis, u)
    bands = round(90.0 / CELL_DEG)
    band = np.minimum((depth[inner] * bands).astype(int), bands - 1)  # equal heights on a sphere have equal areas
    sector = np.floor(np.degrees(np.arctan2(arms[inner] @ v, arms[inner] @ u)) / (2.0 * CELL_DEG)).astype(int)
    return set(zip(band.tolist(), sector.tolist(), strict=True))
