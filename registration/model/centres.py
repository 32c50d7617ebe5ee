"""Where a socket's centre lies in a measured cloud: consensus over spheres of the model's radius."""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.settings import SphereSettings


def sphere_centres(
    points: FloatArray, towards: FloatArray, radius_mm: float, settings: SphereSettings, count: int | None = None
) -> list[FloatArray]:
    """Centres of spheres of a given radius that many points lie on, best first.

    Tissue, rim and fossa do not lie on the sphere, so centres come from triples of points and are judged by a bounded
    consensus (Fischler and Bolles 1981, with the soft count of MSAC), then settled by reweighted least squares.

    Parameters
    ----------
    points : (N, 3) array
        mm.
    towards : (3,) array
        Unit vector to the scanner: the centre lies on that side of the hollow.
    radius_mm : float
    settings : SphereSettings
    count : int, optional
        At most so many centres, apart from each other; as set when not given.

    Returns
    -------
    list of (3,) arrays
        Empty when no triple fits.
    """
    mean = points.mean(axis=0)
    local = points - mean
    centres = _through_triples(local, towards, radius_mm, settings)
    judged = local[:: max(1, len(local) // settings.judged_points)]
    support = soft_count(centres, radius_mm, judged, settings.width_mm)
    thick = local[:: max(1, len(local) // settings.settling_points)]
    found: list[tuple[float, FloatArray]] = []
    for index in np.argsort(-support, kind="stable")[: settings.settled_hypotheses]:
        if _apart(centres[index], found, settings.apart_mm):
            value, centre = _settled(thick, centres[index], radius_mm, settings)
            if _apart(centre, found, settings.apart_mm):
                found.append((value, centre))
        if len(found) == (count or settings.max_centres):
            break
    found.sort(key=lambda entry: -entry[0])
    return [centre + mean for _, centre in found]


def sphere_support(points: FloatArray, centre: FloatArray, radius_mm: float, settings: SphereSettings) -> float:
    """Share of the points (N, 3) that lie on a sphere, softly counted."""
    gap = np.linalg.norm(points - centre, axis=1) - radius_mm
    return float((1.0 / (1.0 + (gap / settings.width_mm) ** 2)).mean())


def _apart(centre: FloatArray, found: list[tuple[float, FloatArray]], apart_mm: float) -> bool:
    return all(np.linalg.norm(centre - other) >= apart_mm for _, other in found)


def _through_triples(points: FloatArray, towards: FloatArray, radius: float, settings: SphereSettings) -> FloatArray:
    """Centres (K, 3) of the spheres of `radius` through random triples, on the scanner's side."""
    triples = np.random.default_rng(0).integers(0, len(points), (settings.hypotheses, 3))
    a, b, c = (points[triples[:, k]] for k in range(3))
    u, v = b - a, c - a
    normal = np.cross(u, v)
    square = (normal**2).sum(axis=1)
    wide = square > (settings.min_triple_share * radius**2) ** 2
    a, u, v, normal, square = a[wide], u[wide], v[wide], normal[wide], square[wide]
    to_centre = np.cross(normal, u) * (v**2).sum(axis=1)[:, None] + np.cross(v, normal) * (u**2).sum(axis=1)[:, None]
    to_centre /= 2.0 * square[:, None]
    rest = radius**2 - (to_centre**2).sum(axis=1)
    fits = rest > 0
    unit = normal[fits] / np.sqrt(square[fits])[:, None]
    unit *= np.sign(unit @ towards)[:, None]
    return np.asarray(a[fits] + to_centre[fits] + unit * np.sqrt(rest[fits])[:, None], dtype=np.float64)


def soft_count(centres: FloatArray, radii_mm: FloatArray | float, points: FloatArray, width_mm: float) -> FloatArray:
    """How many of the points (N, 3) lie on each of K spheres, softly: the sum of ``1 / (1 + (gap / width)^2)``.

    Parameters
    ----------
    centres : (K, 3) array
        mm; near the origin, since single precision is enough for a count.
    radii_mm : (K,) array or float
    points : (N, 3) array
    width_mm : float
    """
    about, on = centres.astype(np.float32), points.astype(np.float32)
    gap = about @ (-2.0 * on.T)
    gap += (about**2).sum(axis=1)[:, None]
    gap += (on**2).sum(axis=1)
    np.sqrt(np.maximum(gap, 0.0, out=gap), out=gap)
    gap -= np.asarray(radii_mm, dtype=np.float32).reshape(-1, 1)
    gap *= np.float32(1.0 / width_mm)
    gap *= gap
    gap += 1.0
    return np.asarray(np.reciprocal(gap, out=gap).sum(axis=1), dtype=np.float64)


def _settled(
    points: FloatArray, centre: FloatArray, radius: float, settings: SphereSettings
) -> tuple[float, FloatArray]:
    """The share of the points on the sphere before a last reweighted step, and the centre after it."""
    gap, stiffness = np.zeros(len(points)), settings.ridge * np.eye(3)
    for width in settings.settling_widths_mm:
        offset = points - centre
        distance = np.linalg.norm(offset, axis=1)
        unit, gap = offset / distance[:, None], distance - radius
        weighted = unit / ((1.0 + (gap / width) ** 2) ** 2)[:, None]
        centre = centre + np.linalg.solve(weighted.T @ unit + stiffness, weighted.T @ gap)
    return float((1.0 / (1.0 + (gap / settings.width_mm) ** 2)).mean()), centre
