"""From a volume to surface points of the bone."""

from picoradar.registration.preoperative.volume import surface_points

__all__ = [
    "surface_points",
]
