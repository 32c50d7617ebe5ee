"""What the range zero is checked by: a mark in the field, or a plate on the bench; and when a check has passed."""

from __future__ import annotations

import datetime
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Literal

from pydantic import Field, field_validator

from picoradar.instrument.calibration.parts import Part
from picoradar.instrument.settings import Method

NEAREST_MM, FARTHEST_MM = 650.0, 700.0  # of the mark: nearer, its echo runs into the reference


class ZeroMark(Part):
    """A mark of known range in a corner of the field: a small plate on a post, or the end of a fibre of that delay.

    Its range counts as that of any point: from mirror 1's axis less the mirror separation, along the beam. It must be
    known by other means than by the radar's own range zero.
    """

    x_deg: float = Field(ge=-20, le=20, description="optical angle of the first mirror at its middle, deg")
    y_deg: float = Field(ge=-20, le=20, description="optical angle of the second mirror at its middle, deg")
    range_mm: float = Field(ge=NEAREST_MM, le=FARTHEST_MM, description="its range, mm")
    sd_mm: float = Field(gt=0, le=1, description="standard deviation of that range, mm")
    side_mm: float = Field(10.0, gt=0, le=100, description="its width and height, mm")


class ZeroInterval(Part):
    """Mean of the readings of a plate by one estimator, before range zero and walk are applied."""

    interval_mm: float = Field(description="c / 2 times the interval between the time-significant points, mm")
    sd_mm: float = Field(ge=0, description="standard error of that mean, mm")
    response_mv: float = Field(gt=0, description="mean amplitude of the echo, mV")


class ZeroPlate(Part):
    """A check of the range zero on a plate at a known distance (``picoradar bench zero``)."""

    date: datetime.datetime = Field(description="when it was measured, with time zone")
    distance_mm: float = Field(ge=100, le=2000, description="distance of the plate as it was stated, mm")
    sd_mm: float = Field(gt=0, le=10, description="standard deviation of that distance, mm")
    measured: dict[Method, ZeroInterval] = Field(description="what each estimator has measured")

    @field_validator("date")
    @classmethod
    def _with_zone(cls, date: datetime.datetime) -> datetime.datetime:
        if date.tzinfo is None:
            raise ValueError("needs a time zone, for example 2026-01-31T12:00:00Z")
        return date.astimezone(datetime.UTC)


@dataclass(frozen=True)
class ZeroLimits:
    """When a check of the range zero passes.

    Attributes
    ----------
    sds : float
        Standard deviations of a difference that are allowed: 3, one false alarm in 370 readings.
    coarsest_mm : float
        Largest limit that still counts as a check. An error of 2 mm is then missed once in a thousand readings at most.
    wander_mm : float
        Standard deviation of what a sound radar's range wanders from reading to reading beside its noise: `bench drift`
        allows 0.1 mm in two hours.
    missed_mm : float
        A reading that is farther off was of something else than the mark.
    same_place_deg : float
        Where two marks are nearer to each other than this, they are the same mark.
    """

    sds: float = 3.0
    coarsest_mm: float = 1.0
    wander_mm: float = 0.05
    missed_mm: float = 20.0
    same_place_deg: float = 0.3


@dataclass(frozen=True)
class ZeroDifference:
    """Measured less known range of one reading.

    Attributes
    ----------
    when : str
        In words, for example ``before line 0``.
    difference_mm : float
        NaN without a usable echo.
    noise_mm : float
        Standard deviation that repeated readings have.
    common_mm : float
        Standard deviation of all that repeating does not reduce: known range, range zero, walk.
    """

    when: str
    difference_mm: float
    noise_mm: float
    common_mm: float


@dataclass(frozen=True)
class ZeroCheck:
    """Outcome of the check of the range zero of a scan.

    Attributes
    ----------
    outcome : {"passed", "failed", "none"}
        ``none``: there is no check, or it can tell nothing.
    sentence : str
        What was found, and what to do.
    by : {"mark", "plate", "nothing"}
    largest_mm, limit_mm : float or None
        The difference (measured less known) that is largest against its limit, and that limit.
    moved_mm, moved_limit_mm : float or None
        Largest change between the first and a later reading, and its limit.
    """

    outcome: Literal["passed", "failed", "none"]
    sentence: str
    by: Literal["mark", "plate", "nothing"] = "nothing"
    largest_mm: float | None = None
    limit_mm: float | None = None
    moved_mm: float | None = None
    moved_limit_mm: float | None = None

    @property
    def passed(self) -> bool:
        """Get whether there is a check and it has passed."""
        return self.outcome == "passed"

    def to_dict(self) -> dict[str, object]:
        """Return it as plain data."""
        return asdict(self)


FAILED = (
    "all ranges may be off by as much, which leaves no trace in the residuals of a registration. Look whether the {by} "
    "is clean and in its place and the radar warm; then calibrate (picoradar bench gray-target) and scan again, or "
    "reprocess this recording with the right calibration."
)


def judge_zero(
    found: Sequence[ZeroDifference], by: Literal["mark", "plate"], limits: ZeroLimits | None = None
) -> ZeroCheck:
    """Judge the readings of a mark or a plate.

    The largest difference fails when it is beyond ``sds`` standard deviations; a change from the first to a later
    reading, too, beyond as many of the noise alone.

    Parameters
    ----------
    found : sequence of ZeroDifference
        At least one, in the order in which they were taken.
    by : {"mark", "plate"}
    limits : ZeroLimits, optional
    """
    s = limits or ZeroLimits()
    for one in found:
        if not abs(one.difference_mm) <= s.missed_mm:  # also NaN
            missed = f"The {by} of the range zero was not found {one.when}"
            what = "clean it, clear the way to it, and see that it stands where the calibration has it"
            return ZeroCheck("none", f"{missed}, so the range zero is not checked: {what}; then scan again.", by)
    limits_mm = [s.sds * math.hypot(one.noise_mm, one.common_mm, s.wander_mm) for one in found]
    worst, limit_mm = max(zip(found, limits_mm, strict=True), key=lambda pair: abs(pair[0].difference_mm) / pair[1])
    moved_mm, moved_limit_mm = _largest_change(found, s)
    figures = (by, worst.difference_mm, limit_mm, moved_mm, moved_limit_mm)
    if abs(worst.difference_mm) > limit_mm:
        what = (
            f"The {by} of known range reads {worst.difference_mm:+.2f} mm {worst.when}, {limit_mm:.2f} mm are allowed"
        )
        return ZeroCheck("failed", f"{what}: {FAILED.format(by=by)}", *figures)
    if moved_mm is not None and moved_limit_mm is not None and abs(moved_mm) > moved_limit_mm:
        what = f"The range of the {by} moved by {moved_mm:+.2f} mm during the scan, {moved_limit_mm:.2f} mm are allowed"
        return ZeroCheck("failed", f"{what}: {FAILED.format(by=by)}", *figures)
    if (coarsest_mm := max(limits_mm)) > s.coarsest_mm:
        what = f"The check of the range zero on the {by} is good for {coarsest_mm:.2f} mm only"
        remedy = "take more averages, or measure its distance and calibrate better"
        return ZeroCheck("none", f"{what}, and shows no error below: {remedy} ({s.coarsest_mm:g} mm).", *figures)
    drift = "" if moved_mm is None else f", and moved by {moved_mm:+.2f} mm"
    what = f"the {by} of known range reads {worst.difference_mm:+.2f} mm (limit {limit_mm:.2f} mm){drift}"
    return ZeroCheck("passed", f"The range zero is checked: {what}.", *figures)


def _largest_change(found: Sequence[ZeroDifference], limits: ZeroLimits) -> tuple[float, float] | tuple[None, None]:
    """Return the change from the first to that later reading which is largest against its limit, and that limit."""

    def change(one: ZeroDifference) -> tuple[float, float]:
        limit_mm = limits.sds * math.hypot(found[0].noise_mm, one.noise_mm, limits.wander_mm)
        return one.difference_mm - found[0].difference_mm, limit_mm

    return max(map(change, found[1:]), key=lambda pair: abs(pair[0]) / pair[1], default=(None, None))
