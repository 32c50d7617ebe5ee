"""Two mirrors a distance apart: angles and range to points and covariances, and back; codes of the scanner.

Scanner frame (mm): origin on the axis of the second mirror, +z out along the undeflected beam, +x across (first
mirror), +y up (second mirror). The first mirror's axis lies ``e`` before the origin along the folded beam. The range
is the length from the first mirror's axis to the target, minus e, so that it is z for the undeflected beam.
With L = range + e and optical angles tx, ty::

    x = L sin(tx)      y = (L cos(tx) - e) sin(ty)      z = (L cos(tx) - e) cos(ty)

Unfolded at the second mirror, all beams of the first mirror lie in one plane and fan out from its axis: x = L sin(tx),
and L cos(tx) - e is the path beyond the second axis, which turns about x.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picoradar.drivers.errors import LimitError
from picoradar.instrument.calibration.parts import ScannerErrors

FloatArray = NDArray[np.float64]
CODES = 4096
CENTRE_CODE = 2048


def codes_to_angles(codes: ArrayLike, field_deg: float) -> FloatArray:
    """Return the optical angles (..., rad) of galvo codes (..., integer): (code - 2048) / 4096 of the field.

    Parameters
    ----------
    codes : (...) int array
    field_deg : float
        Optical angle over all codes.

    Raises
    ------
    LimitError
        For a code outside 0..4095.
    """
    array = np.asarray(codes, dtype=np.int64)
    outside = (array < 0) | (array >= CODES)
    if np.any(outside):
        raise LimitError("galvo", f"code {array[outside].flat[0]} is outside 0..{CODES - 1}")
    return np.asarray((array - CENTRE_CODE) / CODES * np.deg2rad(field_deg), dtype=np.float64)


def angles_to_codes(angles_rad: ArrayLike, field_deg: float) -> NDArray[np.int64]:
    """Return the galvo codes (...) nearest to optical angles (..., rad).

    Parameters
    ----------
    angles_rad : (...) float array
    field_deg : float
        Optical angle over all codes.

    Raises
    ------
    LimitError
        For an angle outside the span, with the angle and the span; nothing is clipped.
    """
    angles = np.asarray(angles_rad, dtype=np.float64)
    wanted = angles / np.deg2rad(field_deg) * CODES + CENTRE_CODE
    outside = ~((wanted >= -0.5) & (wanted < CODES - 0.5))  # also true for NaN
    if np.any(outside):
        degrees = float(np.rad2deg(angles[outside].flat[0]))
        minimum, maximum = -field_deg / 2, field_deg / 2 * (1 - 2 / CODES)
        raise LimitError(
            "galvo",
            f"an optical angle of {degrees:.3f} deg is outside its span of {minimum:.3f} to {maximum:.3f} deg",
            "choose a smaller raster, a larger distance or a larger field_deg",
        )
    return np.asarray(np.rint(wanted), dtype=np.int64)


def true_angles(angles_rad: ArrayLike, errors: ScannerErrors) -> FloatArray:
    """Return the true optical angles (N, 2) of the beam for commanded angles (N, 2)."""
    return np.asarray(angles_rad, dtype=np.float64) @ _linear(errors).T + _offset(errors)


def asked_angles(angles_rad: ArrayLike, errors: ScannerErrors) -> FloatArray:
    """Return the commanded angles (N, 2) that give true optical angles (N, 2); inverse of `true_angles`."""
    return (np.asarray(angles_rad, dtype=np.float64) - _offset(errors)) @ np.linalg.inv(_linear(errors)).T


def points_from(angles_rad: ArrayLike, range_mm: ArrayLike, separation_mm: float) -> FloatArray:
    """Return the points (N, 3) mm for true optical angles (N, 2) rad and ranges (N,) mm; NaN where a range is NaN."""
    tx, ty, length = _unpack(angles_rad, range_mm, separation_mm)
    past = length * np.cos(tx) - separation_mm
    return np.stack([length * np.sin(tx), past * np.sin(ty), past * np.cos(ty)], axis=-1)


def angles_and_range(points_mm: ArrayLike, separation_mm: float) -> tuple[FloatArray, FloatArray]:
    """Return the true optical angles (N, 2) rad and ranges (N,) mm that reach points (N, 3) mm in front of the
    scanner (z > 0); inverse of `points_from`."""
    points = np.asarray(points_mm, dtype=np.float64)
    past = np.hypot(points[..., 1], points[..., 2])
    along = past + separation_mm
    angles = np.stack(
        [np.arctan2(points[..., 0], along), np.arctan2(points[..., 1], points[..., 2])],
        axis=-1,
    )
    return angles, np.hypot(points[..., 0], along) - separation_mm


def jacobian(angles_rad: ArrayLike, range_mm: ArrayLike, separation_mm: float) -> FloatArray:
    """Return the derivatives (N, 3, 3) of the points by (tx, ty, range): rows x, y, z."""
    tx, ty, length = _unpack(angles_rad, range_mm, separation_mm)
    past = length * np.cos(tx) - separation_mm
    sin_x, cos_x, sin_y, cos_y = np.sin(tx), np.cos(tx), np.sin(ty), np.cos(ty)
    zero = np.zeros_like(past)
    rows = [
        np.stack([length * cos_x, zero, sin_x], axis=-1),
        np.stack([-length * sin_x * sin_y, past * cos_y, cos_x * sin_y], axis=-1),
        np.stack([-length * sin_x * cos_y, -past * sin_y, cos_x * cos_y], axis=-1),
    ]
    return np.stack(rows, axis=-2)


def covariance_from(
    angles_rad: ArrayLike,
    range_mm: ArrayLike,
    range_variance_mm2: ArrayLike,
    pointing_sd_rad: float,
    separation_mm: float,
) -> FloatArray:
    """Return the covariance (N, 3, 3) mm^2 of points: J diag(s^2, s^2, var) J^T, with J of `jacobian` at the true
    optical angles, s the deviation of each angle and var the variance of each range."""
    derivative = jacobian(angles_rad, range_mm, separation_mm)
    variance = np.asarray(range_variance_mm2, dtype=np.float64)
    pointing = np.full_like(variance, pointing_sd_rad**2)
    sources = np.stack([pointing, pointing, variance], axis=-1)
    return np.asarray((derivative * sources[..., None, :]) @ np.swapaxes(derivative, -1, -2), dtype=np.float64)


def _unpack(
    angles_rad: ArrayLike, range_mm: ArrayLike, separation_mm: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    angles = np.asarray(angles_rad, dtype=np.float64)
    return angles[..., 0], angles[..., 1], np.asarray(range_mm, dtype=np.float64) + separation_mm


def _linear(errors: ScannerErrors) -> FloatArray:
    return np.array([[1.0 + errors.x_scale, 0.0], [errors.non_orthogonality_rad, 1.0 + errors.y_scale]])


def _offset(errors: ScannerErrors) -> FloatArray:
    return np.array([errors.x_offset_rad, errors.y_offset_rad])
