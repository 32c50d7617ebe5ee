"""`Material`: how much too far a radar reads on bone or tissue, and how well that is known.

Light enters bone and tissue and comes back late, so such a target reads millimetres too far; paint, on which the range
zero is measured, hardly lets any in. How much depends on the material and on how its echo is ranged, so each has an
entry of its own (docs/range-error.md).
"""

from __future__ import annotations

import datetime
import math
from typing import Literal, NamedTuple

from pydantic import Field, SerializerFunctionWrapHandler, field_validator, model_serializer

from picoradar.instrument.calibration.parts import Part
from picoradar.instrument.calibration.stretch import Stretch, stretch_terms

Ranging = Literal["half-maximum", "template", "window"]
"""How an echo is ranged: the two estimators on whole traces, and ``window``, the template on its windows alone."""

ZERO_MATERIAL = "paint"
"""The material that the range zero is measured on; it needs no entry and no correction."""


def in_utc(date: datetime.datetime) -> datetime.datetime:
    """Return a date in UTC.

    Raises
    ------
    ValueError
        When it has no time zone.
    """
    if date.tzinfo is None:
        raise ValueError("needs a time zone, for example 2026-01-31T12:00:00Z")
    return date.astimezone(datetime.UTC)


class Material(Part):
    """How much too far one material reads by one way of ranging, against the paint of the range zero.

    Attributes
    ----------
    bias_mm : float
        What is taken off each range.
    sample_sd_mm : float
        Standard deviation of the bias of the very piece that was measured.
    transfer_sd_mm : float
        What carrying it over to another piece of the same material adds: standard deviation of the difference.
    measured : datetime
    method : str
    stretch : Stretch or None
        How the form of the echo tells the bias of other pieces; None where it was not seen, as in older files.
    """

    bias_mm: float = Field(ge=-5, le=50, description="how much too far it reads, taken off each range, mm")
    sample_sd_mm: float = Field(ge=0, le=50, description="standard deviation of that for the piece measured, mm")
    transfer_sd_mm: float = Field(ge=0, le=50, description="standard deviation that another piece adds, mm")
    measured: datetime.datetime = Field(description="when, with time zone")
    method: str = Field(min_length=1, description="how: procedure, piece, coat, poses")
    stretch: Stretch | None = Field(None, description="how the form of the echo tells the bias of other pieces")

    @field_validator("measured")
    @classmethod
    def _with_zone(cls, date: datetime.datetime) -> datetime.datetime:
        return in_utc(date)

    @model_serializer(mode="wrap")
    def _as_before(self, plain: SerializerFunctionWrapHandler) -> dict[str, object]:
        """Leave out a stretch that is not there: files from before it keep their digest."""
        found: dict[str, object] = plain(self)
        return {name: value for name, value in found.items() if name != "stretch" or value is not None}


class RangeError(NamedTuple):
    """The range error that all points of a scan share, as far as the calibration knows it.

    Attributes
    ----------
    material : str
        Of the target; empty when nobody said.
    bias_mm : float
        What was taken off each range.
    sd_mm : float or None
        Standard deviation of the common error that is left; None when it was never measured.
    """

    material: str
    bias_mm: float
    sd_mm: float | None


def range_error(material: str, entry: Material | None, zero_sd_mm: float | None) -> RangeError:
    """Return the common range error of a scan.

    Parameters
    ----------
    material : str
    entry : Material or None
        Of the material, for the way of ranging; None when there is none.
    zero_sd_mm : float or None
        Of the range zero.
    """
    if entry is None:
        return RangeError(material, 0.0, zero_sd_mm if material == ZERO_MATERIAL else None)
    sd_mm = None if zero_sd_mm is None else math.hypot(zero_sd_mm, entry.sample_sd_mm, entry.transfer_sd_mm)
    return RangeError(material, entry.bias_mm, sd_mm)


def stretch_of(entry: Material | None, zero_sd_mm: float | None) -> dict[str, float] | None:
    """Return what a scan needs to correct its ranges by the form of its echoes; None where that is not known."""
    if entry is None or entry.stretch is None or zero_sd_mm is None or entry.bias_mm <= 0:
        return None
    rest_mm = math.hypot(zero_sd_mm, entry.sample_sd_mm)
    return stretch_terms(entry.bias_mm, entry.transfer_sd_mm, rest_mm, entry.stretch)
