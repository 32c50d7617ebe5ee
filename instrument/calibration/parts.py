"""The parts of a calibration: walk, noise, pulse shapes, errors of the scanner and their uncertainty."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator
from scipy.interpolate import PchipInterpolator

PEAK_ROOM_PS = 400.0
LARGEST = 1e6  # constant of the noise, in ps or the unit of the traces (counts of 16 bit, too): more is no noise


class Part(BaseModel):
    """Base of all parts: unknown keys, NaN and infinity are refused; values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class WalkCorrection(NamedTuple):
    """Timing walk at some responses: ``error_mm`` and its standard deviation ``sd_mm`` (both of the calibration, the
    same for all readings at a response), ``slope_mm_per_mv``, and whether the response is ``inside`` the calibrated
    range; each of the shape of the responses."""

    error_mm: NDArray[np.float64]
    sd_mm: NDArray[np.float64]
    slope_mm_per_mv: NDArray[np.float64]
    inside: NDArray[np.bool_]


class Walk(Part):
    """Timing walk of one estimator: range error against response, from a gray-target series.

    Between its knots the error is interpolated by PCHIP, which never leaves the interval of its two knots: a monotone
    table gives a monotone curve (Fritsch and Carlson, SIAM J. Numer. Anal. 17 (1980) 238). Outside the range the error
    of the nearest end is used, its uncertainty grows linearly by the change over the last interval per such interval,
    and the point is to be flagged.

    Attributes
    ----------
    response_mv, error_mm, sd_mm : tuples of K >= 2 floats
        Knots: response (increasing), range error (measured minus true), and its standard deviation.
    """

    response_mv: tuple[float, ...] = Field(min_length=2, description="response of the knots, increasing, mV")
    error_mm: tuple[float, ...] = Field(min_length=2, description="range error at the knots (measured minus true), mm")
    sd_mm: tuple[float, ...] = Field(min_length=2, description="standard deviation of the error at the knots, mm")

    @model_validator(mode="after")
    def _one_table(self) -> Walk:
        if not len(self.response_mv) == len(self.error_mm) == len(self.sd_mm):
            raise ValueError("response_mv, error_mm and sd_mm must have the same number of knots")
        if np.any(np.diff(self.response_mv) <= 0):
            raise ValueError("response_mv must increase from knot to knot")
        if min(self.sd_mm) < 0:
            raise ValueError("sd_mm must not be negative")
        return self

    @property
    def valid_mv(self) -> tuple[float, float]:
        """Get the range of responses (mV) that was measured."""
        return self.response_mv[0], self.response_mv[-1]

    @cached_property
    def _curves(self) -> tuple[PchipInterpolator, PchipInterpolator, PchipInterpolator]:
        error = PchipInterpolator(self.response_mv, self.error_mm)
        return error, error.derivative(), PchipInterpolator(self.response_mv, self.sd_mm)

    def at(self, response_mv: NDArray[np.float64]) -> WalkCorrection:
        """Look the walk up at some responses (any shape, mV; NaN gives NaN, outside)."""
        response = np.asarray(response_mv, dtype=np.float64)
        low, high = self.valid_mv
        inside = (response >= low) & (response <= high)
        near = np.clip(response, low, high)
        error, slope, sd = self._curves
        knots, errors = np.asarray(self.response_mv), np.asarray(self.error_mm)
        change = np.abs(np.diff(errors) / np.diff(knots))  # mm per mV in each interval
        beyond = np.maximum(low - response, 0.0) * change[0] + np.maximum(response - high, 0.0) * change[-1]
        return WalkCorrection(
            error_mm=np.asarray(error(near), dtype=np.float64),
            sd_mm=np.asarray(sd(near), dtype=np.float64) + beyond,
            slope_mm_per_mv=np.where(inside, slope(near), 0.0),
            inside=inside,
        )


class ShotNoise(Part):
    """Noise of a single sample of a single sweep.

    Variance at a signal s with slope s': ``floor_mv^2 + signal_mv s + (signal_share s)^2 + (jitter_ps s')^2``; the
    terms are bridge, amplifier and A/D, shot noise of the photodiode, energy of the laser pulse, and sampling instant
    against the laser. Every sample is a shot of its own, so the noise of different samples is independent.
    """

    floor_mv: float = Field(0.0, ge=0, le=LARGEST, description="sd between the pulses, mV; 0: that of each trace")
    signal_mv: float = Field(0.0, ge=0, le=LARGEST, description="variance for each mV of signal, mV")
    signal_share: float = Field(0.0, ge=0, le=1, description="sd of the pulse energy, relative")
    jitter_ps: float = Field(0.0, ge=0, le=LARGEST, description="sd of a sampling instant against the laser, ps")


class Templates(Part):
    """Pulse shapes, learnt from the instrument's own averaged reference and echo.

    Every shape has unit peak and its 50 % point on the leading edge at time 0.

    Attributes
    ----------
    start_ps, step_ps : float
        Time of the first value of each shape, and step to the next.
    reference : tuple of N floats
    reference_mv : float
        Amplitude of the reference when it was learnt.
    response_mv : tuple of K floats
        Amplitudes of the echoes when they were learnt, increasing.
    echoes : tuple of K tuples of N floats
        Its shape at each.
    """

    start_ps: float = Field(lt=0, description="time of the first value of each shape, ps")
    step_ps: float = Field(gt=0, le=50, description="time from value to value, ps")
    reference: tuple[float, ...] = Field(min_length=16, description="shape of the reference, unit peak")
    reference_mv: float = Field(gt=0, description="amplitude of the reference, mV")
    response_mv: tuple[float, ...] = Field(min_length=1, description="amplitudes of the echoes, increasing, mV")
    echoes: tuple[tuple[float, ...], ...] = Field(min_length=1, description="shape of the echo at each, unit peak")

    @model_validator(mode="after")
    def _one_table(self) -> Templates:
        if len(self.echoes) != len(self.response_mv):
            raise ValueError("echoes and response_mv must have the same number of entries")
        if any(len(echo) != len(self.reference) for echo in self.echoes):
            raise ValueError("all shapes must have the same number of values")
        if self.response_mv[0] <= 0 or np.any(np.diff(self.response_mv) <= 0):
            raise ValueError("response_mv must be positive and increase")
        if self.start_ps + self.step_ps * len(self.reference) < PEAK_ROOM_PS:
            raise ValueError(f"shapes must reach at least {PEAK_ROOM_PS:g} ps behind the 50 % point")
        return self


class ScannerErrors(Part):
    """Deviations of the optical angles of the two mirrors from the commanded ones.

    ``true_x = (1 + x_scale) x + x_offset`` and ``true_y = (1 + y_scale) y + y_offset + non_orthogonality x``,
    all angles in rad: linear in the errors, which suffices for a calibration at the 0.01 % level.
    """

    x_scale: float = Field(0.0, ge=-0.2, le=0.2, description="relative error of the first mirror's angle")
    y_scale: float = Field(0.0, ge=-0.2, le=0.2, description="relative error of the second mirror's angle")
    x_offset_rad: float = Field(0.0, ge=-0.1, le=0.1, description="angle of the first mirror at zero command, rad")
    y_offset_rad: float = Field(0.0, ge=-0.1, le=0.1, description="angle of the second mirror at zero command, rad")
    non_orthogonality_rad: float = Field(0.0, ge=-0.1, le=0.1, description="share of x that appears in y, rad per rad")


class GeometryUncertainty(Part):
    """Uncertainty of what a geometry calibration has identified.

    Attributes
    ----------
    parameters : tuple of K str
        Names of the identified parameters: those of `ScannerErrors`, ``mirror_separation_mm`` and ``range_zero_mm``.
    covariance : tuple of K tuples of K floats
        Their covariance, in their units.
    """

    parameters: tuple[str, ...] = Field(description="names of the parameters that the poses identified")
    covariance: tuple[tuple[float, ...], ...] = Field(description="their covariance, in mm, rad and shares")

    @model_validator(mode="after")
    def _one_matrix(self) -> GeometryUncertainty:
        if any(len(row) != len(self.parameters) for row in (self.covariance, *self.covariance)):
            raise ValueError("covariance must have a row and a column for each parameter")
        matrix = np.array(self.covariance).reshape(len(self.parameters), len(self.parameters))
        if not np.allclose(matrix, matrix.T, rtol=1e-6) or np.any(np.diag(matrix) < 0):
            raise ValueError("covariance must be symmetric, its diagonal not negative")
        return self

    @property
    def sd(self) -> dict[str, float]:
        """Get the standard deviation of each parameter."""
        return {name: self.covariance[k][k] ** 0.5 for k, name in enumerate(self.parameters)}

    def without(self, name: str) -> GeometryUncertainty:
        """Return the uncertainty of the others, when ``name`` has been measured again in another way."""
        kept = [k for k, one in enumerate(self.parameters) if one != name]
        return GeometryUncertainty(
            parameters=tuple(self.parameters[k] for k in kept),
            covariance=tuple(tuple(self.covariance[row][column] for column in kept) for row in kept),
        )
