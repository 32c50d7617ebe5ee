"""What leaves no trace in the residuals, or too little of one, and has to be known beforehand: the error budget.

Each entry is one standard deviation of what remains *after* correction by what was measured. A row of unit size of each
error (:func:`error_columns`) says how it changes the residuals; how the pose follows is a matter of the information
(``docs/registration.md``, eq. 15).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import RegistrationError

MAX_MM, MAX_SHARE = 100.0, 0.2
"""Largest standard deviations that can be given: lengths, and shares or rad (the scanner's calibration has 0.2)."""

FACETS_MM, FACET_EDGE_MM, VOLUME_LENGTH_MM = 0.02, 1.5, 5.0
"""Error of a model by its facets, and the lengths over which that, and one by voxels and segmentation, is the same."""

GRAZING_COSINE = 0.1
"""Beams that meet the surface flatter than this count as meeting it so: an edge of an echo has a largest walk."""

ON_SPHERE_MM = 1.0
"""Cartilage covers what of a socket lies within this distance of its sphere; the fossa lies deeper."""

MAX_AXIS_RAD = math.radians(20.0)
"""The scanner's z axis is the mirrors' optical axis where the mean beam lies within so much of it."""


@dataclass(frozen=True)
class ErrorBudget:
    """Standard deviations of errors common to many points, of the instrument and of the model.

    Attributes
    ----------
    range_bias_mm : float or None
        Of a range error common to all points: zero and material, as the calibration and the recording have it. None:
        never measured, and the verdict is a caution at best.
    mirror_scale : float
        Of the scale of both mirror angles, and
    mirror_skew_rad : float
        of their non-orthogonality, from the covariance that ``picoradar bench geometry`` writes into the calibration.
        Those given here are five times what its linear model allows for (``ScannerErrors``: 0.01 %).
    walk_mm : float
        Of a range error that grows with incidence, at 60 deg: ``walk_mm (1 / cos - 1)``. Nothing for the ranging's
        calibrated estimators (docs/ranging.md).
    sigma_model_mm : float
        Of the model's surface along its normal, a random field over the surface. 0.02: facets of bones of 20 000 to
        35 000 triangles were 0.004 to 0.011 mm off the finer mesh about the socket (measured). Surfaces from a CT of
        1 mm: 0.1 graded, 0.17 from a binary mask (measured beside a socket).
    model_correlation_mm : float or None
        Length over which that field is the same: its correlation is ``exp(-(d / length)^2)``. None: 1.5, the edge of a
        facet, as long as `sigma_model_mm` is no more than facets make, else 5, as surfaces from volumes have it.
    model_offset_mm : float
        Of the model's surface being too large (or too small) all over, as by the threshold of a CT: half a voxel where
        nobody chose it with care. Nothing for models that were measured or designed.
    model_scale : float
        Of the model's size: of a CT 0.001 where its phantom was scanned.
    cartilage_mm : float
        Of the thickness of cartilage on the sockets that the model lacks: 1.5 where it lacks all of it.
    """

    range_bias_mm: float | None = None
    mirror_scale: float = 5e-4
    mirror_skew_rad: float = 5e-4
    walk_mm: float = 0.0
    sigma_model_mm: float = FACETS_MM
    model_correlation_mm: float | None = None
    model_offset_mm: float = 0.0
    model_scale: float = 0.0
    cartilage_mm: float = 0.0

    def __post_init__(self) -> None:
        """Check what was given.

        Raises
        ------
        RegistrationError
        """
        for entry in fields(self):
            value = getattr(self, entry.name)
            most = MAX_MM if entry.name.endswith("_mm") else MAX_SHARE
            if value is not None and not 0.0 <= value <= most:
                raise RegistrationError(
                    f"{entry.name} is {value}: give one standard deviation of what remains, 0 to {most:g}, or leave it "
                    "out" + (" where it was never measured" if entry.name == "range_bias_mm" else "")
                )
        if self.model_correlation_mm == 0.0:
            raise RegistrationError(
                "model_correlation_mm is 0: give the length over which the model's error is the same"
            )

    @classmethod
    def from_mapping(cls, entries: Mapping[str, float | None]) -> ErrorBudget:
        """Make a budget of ``{"range_bias_mm": 0.4, "model_offset_mm": 0.3, ...}``; what is not in it is as usual.

        Raises
        ------
        RegistrationError
            For a name that no entry has, and for what is no standard deviation.
        """
        names = [entry.name for entry in fields(cls)]
        if not isinstance(entries, Mapping):
            raise RegistrationError(f"an error budget is an object with any of: {', '.join(names)}")
        for name, value in entries.items():
            if name not in names:
                raise RegistrationError(f"the error budget has no entry {name!r}: give any of {', '.join(names)}")
            if not (isinstance(value, int | float) or (value is None and name == "range_bias_mm")):
                raise RegistrationError(f"{name} is {value!r}: give a number, one standard deviation of what remains")
        return cls(**{name: float(value) for name, value in entries.items() if value is not None})

    @property
    def correlation_mm(self) -> float:
        """Length over which the model's error is the same, as given or as usual."""
        if self.model_correlation_mm is not None:
            return self.model_correlation_mm
        return FACET_EDGE_MM if self.sigma_model_mm <= FACETS_MM else VOLUME_LENGTH_MM

    @property
    def biases(self) -> dict[str, float]:
        """Standard deviations of the errors that have a shape of their own, by name; the range's 0 where unknown."""
        return {
            "range": self.range_bias_mm or 0.0,
            "mirror scale": self.mirror_scale,
            "mirror skew": self.mirror_skew_rad,
            "walk": self.walk_mm,
            "model offset": self.model_offset_mm,
            "model scale": self.model_scale,
            "cartilage": self.cartilage_mm,
        }


@dataclass(frozen=True)
class Socket:
    """A socket of the model.

    Attributes
    ----------
    centre : (3,) array
        mm.
    radius_mm : float
    axis : (3,) array
        Unit vector that it opens along.
    vertices : (V, 3) array
        Of the model.
    """

    centre: FloatArray
    radius_mm: float
    axis: FloatArray
    vertices: FloatArray


@dataclass(frozen=True)
class Seen:
    """Where and how the points were seen, in the model frame.

    Attributes
    ----------
    places, normals, beams : (N, 3) arrays
        Points, normals of the surface there, and unit directions of the beams.
    arms : (N, 3) array
        Points from the scanner's origin.
    mirrors : (3, 3) array
        Columns: the mirrors' x and y directions and their optical axis.
    centre : (3,) array
        What scales with the model does so about this point.
    sockets : sequence of Socket
    """

    places: FloatArray
    normals: FloatArray
    beams: FloatArray
    arms: FloatArray
    mirrors: FloatArray
    centre: FloatArray
    sockets: Sequence[Socket] = ()


def error_columns(seen: Seen, names: Sequence[str]) -> FloatArray:
    """Change of each point's residual across the surface by a unit of each error, (N, K)."""
    columns = {
        "range": _of_range,
        "mirror scale": _of_mirror_scale,
        "mirror skew": _of_mirror_skew,
        "walk": _of_walk,
        "model offset": _of_offset,
        "model scale": _of_model_scale,
        "cartilage": _of_cartilage,
    }
    if not names:
        return np.zeros((len(seen.places), 0))
    return np.stack([columns[name](seen) for name in names], axis=1)


def mirror_axes(beams: FloatArray, rotation: FloatArray) -> FloatArray:
    """Columns (3, 3), model frame: the mirrors' x, y and optical axis, of beams (N, 3) in the scanner's frame.

    The optical axis is the scanner's z, or the mean beam of clouds that look elsewhere."""
    mean = beams.mean(axis=0)
    mean = mean / np.linalg.norm(mean)
    if mean[2] > math.cos(MAX_AXIS_RAD):
        return rotation
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(mean)))], mean)
    x /= np.linalg.norm(x)
    return np.asarray(rotation @ np.stack([x, np.cross(mean, x), mean], axis=1), dtype=np.float64)


def _of_range(seen: Seen) -> FloatArray:
    return np.asarray(np.einsum("ij,ij->i", seen.normals, seen.beams), dtype=np.float64)


def _of_walk(seen: Seen) -> FloatArray:
    along = _of_range(seen)
    return along * (1.0 / np.maximum(-along, GRAZING_COSINE) - 1.0)


def _of_mirror_scale(seen: Seen) -> FloatArray:
    x, y = seen.arms @ seen.mirrors[:, 0], seen.arms @ seen.mirrors[:, 1]
    return _turned(seen, x[:, None] * seen.mirrors[:, 0] + y[:, None] * seen.mirrors[:, 1])


def _of_mirror_skew(seen: Seen) -> FloatArray:
    return _turned(seen, (seen.arms @ seen.mirrors[:, 0])[:, None] * seen.mirrors[:, 1])


def _turned(seen: Seen, shift: FloatArray) -> FloatArray:
    """Residuals' change (N,) where points move by `shift` (N, 3) at the same range: across their beams alone."""
    across = shift - np.einsum("ij,ij->i", shift, seen.beams)[:, None] * seen.beams
    return np.asarray(np.einsum("ij,ij->i", seen.normals, across), dtype=np.float64)


def _of_offset(seen: Seen) -> FloatArray:
    return np.full(len(seen.places), -1.0)


def _of_model_scale(seen: Seen) -> FloatArray:
    return np.asarray(-np.einsum("ij,ij->i", seen.normals, seen.places - seen.centre), dtype=np.float64)


def _of_cartilage(seen: Seen) -> FloatArray:
    covered = np.zeros(len(seen.places))
    for socket in seen.sockets:
        covered[np.abs(np.linalg.norm(seen.places - socket.centre, axis=1) - socket.radius_mm) < ON_SPHERE_MM] = 1.0
    return covered
