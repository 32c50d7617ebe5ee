"""`Calibration`: what was measured about one instrument, in a JSON file that recordings name by its digest."""

from __future__ import annotations

import datetime
import hashlib
import json
from functools import cached_property
from pathlib import Path
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator
from scipy.interpolate import PchipInterpolator

from instrument.errors import BadInput

Method = Literal["half-maximum", "template"]
METHODS: tuple[Method, ...] = get_args(Method)
FORMAT: Literal[1] = 1
PEAK_ROOM_PS = 400.0


class _Part(BaseModel):
    """Common to all parts: unknown keys, NaN and infinity are refused; values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class WalkCorrection(NamedTuple):
    """Timing walk at some responses: ``error_mm`` and its standard deviation ``sd_mm`` (both of the calibration, the
    same for all readings at a response), ``slope_mm_per_mv``, and where the response lies ``inside`` the calibrated
    range; each of the shape of the responses."""

    error_mm: NDArray[np.float64]
    sd_mm: NDArray[np.float64]
    slope_mm_per_mv: NDArray[np.float64]
    inside: NDArray[np.bool_]


class Walk(_Part):
    """Timing walk of one estimator: range error against response, from a gray-target series.

    Between its knots the error is interpolated by PCHIP, which never leaves the interval of its two knots: a monotone
    table gives a monotone curve (Fritsch and Carlson, SIAM J. Numer. Anal. 17 (1980) 238). Outside the range the error
    of the nearest end is used, its uncertainty grows by what the curve changed over the last interval for each such
    interval further out, and the point is to be flagged.

    Attributes
    ----------
    response_mv, error_mm, sd_mm : tuples of K >= 2 floats
        Knots: response (increasing), what the range comes out too long by, and standard deviation of that.
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


class ShotNoise(_Part):
    """Noise of a single sample of a single sweep.

    Variance at a signal s with slope s': ``floor_mv^2 + signal_mv s + (signal_share s)^2 + (jitter_ps s')^2``; the
    terms are bridge, amplifier and A/D, shot noise of the photodiode, energy of the laser pulse, and sampling instant
    against the laser. Every sample is a shot of its own, so the noise of different samples is independent.
    """

    floor_mv: float = Field(0.0, ge=0, le=100, description="sd between the pulses; 0: not known, see each trace, mV")
    signal_mv: float = Field(0.0, ge=0, le=10, description="variance for each mV of signal, mV")
    signal_share: float = Field(0.0, ge=0, le=1, description="sd of the pulse energy, relative")
    jitter_ps: float = Field(0.0, ge=0, le=1000, description="sd of a sampling instant against the laser, ps")


class Templates(_Part):
    """Pulse shapes, learnt from the instrument's own averaged reference and echo.

    Every shape has unit peak and its 50 % point on the leading edge at time 0.

    Attributes
    ----------
    start_ps, step_ps : float
        Time of the first value of each shape, and step to the next.
    reference : tuple of N floats
    reference_mv : float
        Amplitude at which the reference was seen.
    response_mv : tuple of K floats
        Amplitudes at which the echo was seen, increasing.
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


class ScannerErrors(_Part):
    """How the optical angles of the two mirrors differ from those asked for.

    ``true_x = (1 + x_scale) x + x_offset`` and ``true_y = (1 + y_scale) y + y_offset + non_orthogonality x``,
    all angles in rad: linear in the errors, which is what a calibration at the 0.01 % level can see.
    """

    x_scale: float = Field(0.0, ge=-0.2, le=0.2, description="relative error of the first mirror's angle")
    y_scale: float = Field(0.0, ge=-0.2, le=0.2, description="relative error of the second mirror's angle")
    x_offset_rad: float = Field(0.0, ge=-0.1, le=0.1, description="angle of the first mirror at zero command, rad")
    y_offset_rad: float = Field(0.0, ge=-0.1, le=0.1, description="angle of the second mirror at zero command, rad")
    non_orthogonality_rad: float = Field(0.0, ge=-0.1, le=0.1, description="share of x that appears in y, rad per rad")


class Calibration(_Part):
    """Everything that ranging and geometry must know of one instrument.

    `digest` names the content: two files with the same values have the same digest whatever their layout.
    """

    format: Literal[1] = Field(FORMAT, description="version of this file's layout")
    date: datetime.datetime = Field(description="when it was measured, with time zone")
    provenance: str = Field(min_length=1, description="how it was measured: procedure, target, recording, operator")
    serial_numbers: dict[str, str] = Field(default_factory=dict, description="device name to serial number")
    diode_degc: float | None = Field(None, description="temperature of the laser diode while it was measured, degC")

    range_zero_mm: float = Field(0.0, description="range at zero interval between the two time-significant points, mm")
    walk: dict[Method, Walk] = Field(default_factory=dict, description="timing walk, for each estimator")
    templates: Templates | None = Field(None, description="pulse shapes for the template estimator")
    noise: ShotNoise = Field(default_factory=ShotNoise, description="noise of a single sample of a single sweep")
    reference_ps: tuple[float, float] | None = Field(
        None, description="earliest and latest place of the reference's 50 % point on the trace, ps"
    )

    mirror_separation_mm: float = Field(ge=0, le=1000, description="distance of the two mirror axes, mm")
    scanner: ScannerErrors = Field(default_factory=ScannerErrors, description="errors of the mirrors' angles")
    pointing_sd_rad: float = Field(0.0, ge=0, le=0.1, description="sd of each optical angle after settling, rad")

    @field_validator("date")
    @classmethod
    def _with_zone(cls, date: datetime.datetime) -> datetime.datetime:
        if date.tzinfo is None:
            raise ValueError("needs a time zone, for example 2026-01-31T12:00:00Z")
        return date.astimezone(datetime.UTC)

    @property  # not cached: `model_copy` would take the old digest along
    def digest(self) -> str:
        """Get ``sha256:`` and the hash of the content in canonical JSON (sorted keys, no spaces, UTF-8)."""
        canonical = json.dumps(self.model_dump(mode="json"), sort_keys=True, separators=(",", ":"), ensure_ascii=False)
        return "sha256:" + hashlib.sha256(canonical.encode()).hexdigest()

    def save(self, path: Path) -> None:
        """Write the calibration as JSON; a file that is there is replaced as a whole or not at all."""
        partial = path.with_name(path.name + ".partial")
        partial.write_text(json.dumps(self.model_dump(mode="json"), indent=1) + "\n", encoding="utf-8")
        partial.replace(path)

    @classmethod
    def load(cls, path: Path) -> Calibration:
        """Read and check a calibration file.

        Raises
        ------
        BadInput
            With the file, the key, what was found and what is allowed.
        """
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise BadInput(
                f"{path}: cannot read the calibration: {error}; give a file that a bench procedure made"
            ) from error
        return cls.from_json(text, str(path))

    @classmethod
    def from_json(cls, text: str, source: str) -> Calibration:
        """Check a calibration given as JSON text, for example out of a recording; ``source`` is for messages.

        Raises
        ------
        BadInput
            As `load`.
        """
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            found = "; ".join(
                f"{'.'.join(map(str, e['loc'])) or 'calibration'}: {e['msg'].removeprefix('Value error, ')}"
                for e in error.errors(include_url=False)
            )
            raise BadInput(
                f"{source}: not a valid calibration: {found}; make it again with a bench procedure"
            ) from error
