"""`Calibration`: the measured properties of one instrument, in a JSON file that recordings refer to by its digest."""

from __future__ import annotations

import datetime
import hashlib
import json
from pathlib import Path
from typing import Literal

from pydantic import Field, PrivateAttr, ValidationError, field_validator

from picoradar.drivers.errors import parse_json, read_text
from picoradar.instrument.calibration.materials import (
    Material,
    RangeError,
    Ranging,
    in_utc,
    range_error,
    stretch_of,
)
from picoradar.instrument.calibration.parts import (
    GeometryUncertainty,
    Part,
    ScannerErrors,
    ShotNoise,
    Templates,
    Walk,
)
from picoradar.instrument.calibration.stretch import Stretch
from picoradar.instrument.calibration.zero import ZeroMark, ZeroPlate
from picoradar.instrument.errors import BadInput
from picoradar.instrument.settings import Method

FORMAT: Literal[1] = 1
_MAKE_AGAIN = "make it again with a bench procedure"

LATER: dict[str, object] = {"range_zero_sd_mm": None, "materials": {}, "zero_mark": None, "zero_plate": None}
"""Fields that came later, and their values in files from before: left out, so that these keep their digest."""


class Calibration(Part):
    """Everything that ranging and geometry need to know about one instrument.

    `digest` identifies the content: two files with the same values have the same digest, whatever their layout.
    """

    format: Literal[1] = Field(FORMAT, description="version of this file's layout")
    date: datetime.datetime = Field(description="when it was measured, with time zone")
    provenance: str = Field(min_length=1, description="how it was measured: procedure, target, recording, operator")
    serial_numbers: dict[str, str] = Field(default_factory=dict, description="device name to serial number")
    diode_degc: float | None = Field(None, description="temperature of the laser diode while it was measured, degC")

    range_zero_mm: float = Field(0.0, description="range at zero interval between the two time-significant points, mm")
    range_zero_sd_mm: float | None = Field(
        None, ge=0, le=100, description="its standard deviation, mm; none: not known"
    )
    materials: dict[str, dict[Ranging, Material]] = Field(
        default_factory=dict, description="range error on each material that was measured, for each way of ranging"
    )
    walk: dict[Method, Walk] = Field(default_factory=dict, description="timing walk, for each estimator")
    templates: Templates | None = Field(None, description="pulse shapes for the template estimator")
    noise: ShotNoise = Field(default_factory=ShotNoise, description="noise of a single sample of a single sweep")
    reference_ps: tuple[float, float] | None = Field(
        None, description="earliest and latest place of the reference's 50 % point on the trace, ps"
    )

    mirror_separation_mm: float = Field(ge=0, le=1000, description="distance of the two mirror axes, mm")
    scanner: ScannerErrors = Field(default_factory=ScannerErrors, description="errors of the mirrors' angles")
    geometry: GeometryUncertainty | None = Field(None, description="uncertainty of the geometry calibration")
    pointing_sd_rad: float = Field(0.0, ge=0, le=0.1, description="sd of each optical angle after settling, rad")

    zero_mark: ZeroMark | None = Field(None, description="mark by which every scan checks the range zero")
    zero_plate: ZeroPlate | None = Field(None, description="last check of the range zero on a plate (bench zero)")

    _stretch: Stretch | None = PrivateAttr(None)

    @field_validator("date")
    @classmethod
    def _with_zone(cls, date: datetime.datetime) -> datetime.datetime:
        return in_utc(date)

    @property  # not cached: `model_copy` would take the old digest along
    def digest(self) -> str:
        """Get ``sha256:`` and the hash of the content in canonical JSON (sorted keys, no spaces, UTF-8)."""
        canonical = json.dumps(self.content(), sort_keys=True, separators=(",", ":"), ensure_ascii=False)
        return "sha256:" + hashlib.sha256(canonical.encode()).hexdigest()

    def content(self) -> dict[str, object]:
        """Return all values as plain JSON types; those of `LATER` only where they are set."""
        every: dict[str, object] = self.model_dump(mode="json")
        return {name: value for name, value in every.items() if name not in LATER or value != LATER[name]}

    def for_material(self, material: str, ranging: Ranging) -> Calibration:
        """Return the calibration that ranges this material without its bias; itself where none was measured."""
        entry = self.materials.get(material, {}).get(ranging)
        if entry is None:
            return self
        ranged = self.model_copy(update={"range_zero_mm": self.range_zero_mm - entry.bias_mm})
        ranged._stretch = entry.stretch
        return ranged

    @property
    def stretch(self) -> Stretch | None:
        """Get how echoes of the material are stretched, of a calibration for one (`for_material`); None else."""
        return self._stretch

    def stretch_terms(self, material: str, ranging: Ranging) -> dict[str, float] | None:
        """Return what is needed to correct ranges on this material by the form of their echoes; None: not known."""
        return stretch_of(self.materials.get(material, {}).get(ranging), self.range_zero_sd_mm)

    def range_error(self, material: str, ranging: Ranging) -> RangeError:
        """Return what is known of the range error that all points on this material share."""
        return range_error(material, self.materials.get(material, {}).get(ranging), self.range_zero_sd_mm)

    def save(self, path: Path) -> None:
        """Write the calibration as JSON; an existing file is replaced completely or not at all."""
        partial = path.with_name(path.name + ".partial")
        partial.write_text(json.dumps(self.content(), indent=1) + "\n", encoding="utf-8")
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
            text = read_text(path)
        except (OSError, ValueError) as error:
            raise BadInput(
                f"{path}: cannot read the calibration: {error}; give a file that a bench procedure made"
            ) from error
        return cls.from_json(text, str(path))

    @classmethod
    def from_json(cls, text: str, source: str) -> Calibration:
        """Check a calibration given as JSON text, for example from a recording.

        Parameters
        ----------
        text : str
        source : str
            Where it comes from, for the messages.

        Raises
        ------
        BadInput
            With the source, the key, what was found and what is allowed.
        """
        try:
            parse_json(text)
        except ValueError as error:
            raise BadInput(f"{source}: not a valid calibration: {error}; {_MAKE_AGAIN}") from error
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            found = "; ".join(
                f"{'.'.join(map(str, e['loc'])) or 'calibration'}: {e['msg'].removeprefix('Value error, ')}"
                for e in error.errors(include_url=False)
            )
            raise BadInput(f"{source}: not a valid calibration: {found}; {_MAKE_AGAIN}") from error
