"""The motions that the points hold worst, in words: axis, pivot and pitch, beside what the clinic allows.

A small motion is a screw: a turn about an axis through a pivot, with an advance along it (its pitch), or a mere slide.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.trust.budget import Socket
from picoradar.registration.trust.evidence import Tolerance
from picoradar.registration.trust.fit import Assessed

SLIDING_TURN = 0.2
"""A motion that turns by less, in shares of its whole, is described as sliding."""

SCREW_PITCH = 0.2
"""A turn that advances by less than this share of the points' radius is described without its advance."""

SDS_95 = 1.96
"""Standard deviations of one Gaussian motion that hold 95 % of all cases."""

SAME_AXIS_COSINE, SAME_PLACE_MM = 0.95, 5.0
"""An axis within 18 deg of a socket's, and one that passes its centre this near, are called by its name."""


def weak_directions(fit: Assessed, tolerance: Tolerance, sockets: Sequence[Socket] = (), count: int = 2) -> list[str]:
    """Describe the `count` worst-held motions, worst first."""
    radius = fit.points.radius_mm
    scale = np.array([radius] * 3 + [1.0] * 3)
    variances, motions = np.linalg.eigh(fit.covariance * np.outer(scale, scale))
    worst = [(motions[:, -1 - k], float(np.sqrt(max(0.0, variances[-1 - k])))) for k in range(count)]
    return [
        describe_weakness(np.append(axis[:3] / radius, axis[3:]) * sd, fit.centre, radius, tolerance, sockets)
        for axis, sd in worst
    ]


def describe_weakness(
    motion: FloatArray, centre: FloatArray, radius_mm: float, tolerance: Tolerance, sockets: Sequence[Socket] = ()
) -> str:
    """Say in words how far a motion may be off, and whether that is more than is allowed.

    Parameters
    ----------
    motion : (6,) array
        One standard deviation: rotation vector in rad, translation in mm.
    centre : (3,) array
        Point of the model frame that it turns about.
    radius_mm : float
        Root mean square distance of the points from it.
    tolerance : Tolerance
    sockets : sequence of Socket
        Of the model.
    """
    rotation, shift = motion[:3], motion[3:]
    turn, slide = float(np.linalg.norm(rotation)), float(np.linalg.norm(shift))
    if turn * radius_mm < SLIDING_TURN * float(np.hypot(turn * radius_mm, slide)):
        bound = _bound("slide", SDS_95 * slide, "mm", tolerance.target_mm)
        return f"{bound}; sliding along {_numbers(shift / slide)}"
    axis = rotation / turn
    pivot = centre + np.cross(rotation, shift) / turn**2
    pitch = float(shift @ axis) / turn
    screw = f", advancing {pitch * 2 * np.pi:.0f} mm a turn" if abs(pitch) > SCREW_PITCH * radius_mm else ""
    where = f"the axis {_numbers(axis)} through ({pivot[0]:.1f}, {pivot[1]:.1f}, {pivot[2]:.1f}) mm"
    about = f"rotate about {_name(axis, pivot, sockets)}"
    bound = _bound(about, SDS_95 * float(np.degrees(turn)), "deg", tolerance.rotation_deg)
    return f"{bound}; turning about {where}{screw}"


def _bound(what: str, value: float, unit: str, limit: float) -> str:
    free = value > limit
    return f"{'free to' if free else 'held; may'} {what}: +-{value:.2g} {unit} (95 %), the limit is {limit:g} {unit}"


def _name(axis: FloatArray, pivot: FloatArray, sockets: Sequence[Socket]) -> str:
    """What an axis is called, by the socket whose centre it passes."""
    for socket in sockets:
        if float(np.linalg.norm(np.cross(axis, socket.centre - pivot))) < SAME_PLACE_MM:
            along = abs(float(axis @ socket.axis)) > SAME_AXIS_COSINE
            return "the socket's axis" if along else "the socket's centre"
    return "one axis"


def _numbers(vector: FloatArray) -> str:
    return f"({vector[0]:+.2f}, {vector[1]:+.2f}, {vector[2]:+.2f})"
