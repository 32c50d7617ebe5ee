"""The header of a recording: what one must know to use its numbers, as one JSON object."""

from __future__ import annotations

import enum
import hashlib
import json
import math
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import metadata
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import CodeScale
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import StretchTerms
from picoradar.instrument.recording.limits import MOST_COLUMNS, MOST_ROWS, MOST_SAMPLES

MOST_TERM = 1000.0  # of the terms of the stretch of echoes: mm and shares, all far below it
POSITIVE = ("bias_mm", "piece_sd", "power")
_TRACE = ("start_ps", "step_ps", "samples", "zero_code", "mv_per_code")


@dataclass(frozen=True)
class TraceForm:
    """Instants and scale of the traces of a recording, by its header.

    Attributes
    ----------
    start_ps, step_ps : float
        First sampling instant after the trigger, and step.
    samples : int
    scale : CodeScale
    """

    start_ps: float
    step_ps: float
    samples: int
    scale: CodeScale

    @cached_property
    def times_ps(self) -> NDArray[np.float64]:
        """Get the (S,) sampling instants."""
        return np.asarray(self.start_ps + self.step_ps * np.arange(self.samples), dtype=np.float64)

    @classmethod
    def of(cls, trace: JsonObject) -> TraceForm:
        """Take it from the header's ``trace``."""
        scale = CodeScale(trace["zero_code"], trace["mv_per_code"])
        return cls(trace["start_ps"], trace["step_ps"], trace["samples"], scale)


def versions() -> dict[str, str]:
    """Get the versions of all that takes part in the numbers."""
    found = {"python": platform.python_version()}
    for name in ("picoradar", "numpy", "scipy"):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed as a package"
    return found


def digest(content: object) -> str:
    """Return the SHA-256 (hex) of a JSON value in its one canonical form."""
    return hashlib.sha256(canonical(content).encode()).hexdigest()


def canonical(content: object) -> str:
    """Return the JSON text with sorted keys; a number that is not finite becomes null, as in all of picoradar's JSON.

    Raises
    ------
    ValueError
        If something in it has no JSON form.
    """
    return json.dumps(plain(content), sort_keys=True, allow_nan=False, ensure_ascii=False, separators=(",", ":"))


def plain(content: object) -> Any:
    """Return the content made of dicts, lists, strings, numbers, booleans and None alone.

    Raises
    ------
    ValueError
        Naming the type that has no JSON form.
    """
    if content is None or (isinstance(content, (str, bool, int)) and not isinstance(content, enum.Enum)):
        return content
    if isinstance(content, (float, np.floating)):
        return float(content) if math.isfinite(content) else None
    if isinstance(content, enum.Enum):
        return plain(content.value)
    if isinstance(content, (np.integer, np.bool_)):
        return content.item()
    if isinstance(content, np.ndarray):
        return plain(content.tolist())
    if isinstance(content, Mapping):
        return {str(key): plain(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [plain(value) for value in content]
    if isinstance(content, PurePath):
        return str(content)
    raise ValueError(f"a {type(content).__name__} has no JSON form")


def complete_header(header: JsonObject) -> JsonObject:
    """Check a header and add what the recording knows by itself (versions, digest of the calibration).

    Raises
    ------
    ValueError
        Naming the key that is missing or wrong.
    """
    full: JsonObject = plain({"versions": versions(), "calibration": None, **header})
    full.setdefault("calibration_digest", digest(full["calibration"]))
    return checked_header(full)


def checked_header(header: JsonObject) -> JsonObject:
    """Return a header if it is one: the same for those that are written and those that are read.

    Raises
    ------
    ValueError
        Naming the key that is missing or wrong.
    """
    raster = header.get("raster")
    if not isinstance(raster, dict):
        raise ValueError("the header has no `raster` (rows, columns, step_mm, mode, averages)")
    for name, most in (("rows", MOST_ROWS), ("columns", MOST_COLUMNS)):
        if not _is_count(count := raster.get(name), most):
            raise ValueError(f"raster.{name} of the header is {count!r}, not a whole number from 1 up to {most}")
    for name in ("step_mm", "distance_mm", "interval_s", "averages"):
        if not _is_number(raster.get(name, 0)):
            raise ValueError(f"raster.{name} of the header is {raster[name]!r}, not a number")
    for name in ("plan", "mode", "estimator", "order"):
        if not isinstance(raster.get(name, ""), str):
            raise ValueError(f"raster.{name} of the header is {raster[name]!r}, not a word")
    for name in ("settings", "calibration", "scanner", "versions", "trace", "range_error", "stretch"):
        if not isinstance(header.get(name), dict | None):
            raise ValueError(f"the header's `{name}` is no JSON object")
    if header.get("trace") is not None:
        _check_trace(header["trace"])
    if header.get("range_error") is not None:
        check_range_error(header["range_error"])
    if header.get("stretch") is not None:
        _check_stretch(header["stretch"])
    return header


def _check_trace(trace: JsonObject) -> None:
    if not set(_TRACE) <= set(trace):
        raise ValueError(f"the header's `trace` needs {', '.join(_TRACE)}")
    if not _is_count(count := trace["samples"], MOST_SAMPLES):
        raise ValueError(f"trace.samples of the header is {count!r}, not a whole number from 1 up to {MOST_SAMPLES}")
    for name in set(_TRACE) - {"samples"}:
        if not _is_number(trace[name]):
            raise ValueError(f"trace.{name} of the header is {trace[name]!r}, not a number")


def check_range_error(known: JsonObject) -> None:
    """Check what a header says of the range error that all points share.

    Raises
    ------
    ValueError
        Naming the key that is wrong.
    """
    if not isinstance(known.get("material", ""), str):
        raise ValueError(f"range_error.material of the header is {known['material']!r}, not a word")
    if not _is_number(known.get("bias_mm", 0)):
        raise ValueError(f"range_error.bias_mm of the header is {known['bias_mm']!r}, not a number")
    sd_mm = known.get("sd_mm")
    if sd_mm is not None and not (_is_number(sd_mm) and sd_mm >= 0):
        raise ValueError(f"range_error.sd_mm of the header is {sd_mm!r}, neither null nor a number from 0 on")


def _check_stretch(known: JsonObject) -> None:
    for name in StretchTerms._fields:
        value = known.get(name, 0.0 if name in StretchTerms._field_defaults else -1.0)
        if not _is_number(value) or not 0 <= value <= MOST_TERM or (name in POSITIVE and not value):
            raise ValueError(f"stretch.{name} of the header is {value!r}, not a number from 0 to {MOST_TERM:g}")


def _is_count(value: object, most: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= most


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
