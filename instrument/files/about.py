"""What a point file says of its points beside their numbers: the range error that they share, and the check of the
range zero of their scan. Neither leaves a trace in the points, so whoever registers them must be told.

It is written as JSON text under two names, in whatever place a format has for it (docs/recording.md, Exports).
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from picoradar.drivers.errors import parse_json
from picoradar.instrument.recording import Cloud, Recording, check_range_error, plain, range_error_in

RANGE_ERROR, ZERO_CHECK = "range_error", "zero_check"
NAMES = (RANGE_ERROR, ZERO_CHECK)
_COMMENT = re.compile(rf"picoradar ({'|'.join(NAMES)}) (\{{.*\}})")

Json = dict[str, Any]
_WORDS = {"outcome": ("passed", "failed", "none"), "by": ("mark", "plate", "nothing")}
_FIGURES = ("largest_mm", "limit_mm", "moved_mm", "moved_limit_mm")


@dataclass(frozen=True)
class CommonError:
    """The range error that all points share.

    Attributes
    ----------
    material : str
        What was scanned; empty when nobody said.
    bias_mm : float
        What was taken off each range for it.
    sd_mm : float or None
        Standard deviation of what is left; None when it was never measured.
    """

    material: str
    bias_mm: float
    sd_mm: float | None


@dataclass(frozen=True)
class About:
    """What a file says of its points.

    Attributes
    ----------
    range_error : CommonError or None
        None if it does not say.
    zero_check : dict or None
        Arguments of the `ZeroCheck` of its scan; None if it does not say.
    """

    range_error: CommonError | None = None
    zero_check: Json | None = None


def texts_of(recording: Recording, cloud: Cloud, zero_check: Mapping[str, object] | None) -> dict[str, str]:
    """Return what is to be written about a recording's points: JSON text (ASCII, one line) by name.

    Parameters
    ----------
    recording : Recording
    cloud : Cloud
        All its points.
    zero_check : mapping or None
        Of a check of the range zero (`ZeroCheck.to_dict`).
    """
    told: dict[str, Mapping[str, object]] = {}
    if known := range_error_in(recording.header, cloud):
        zero_sd_mm = (recording.header.get("calibration") or {}).get("range_zero_sd_mm")
        told[RANGE_ERROR] = {**known, **_shares(known.get("sd_mm"), zero_sd_mm)}
    if zero_check is not None:
        told[ZERO_CHECK] = zero_check
    return {name: json.dumps(plain(content), sort_keys=True, allow_nan=False) for name, content in told.items()}


def _shares(sd_mm: object, zero_sd_mm: object) -> dict[str, float | None]:
    """Return the standard deviations of range zero and of the material's bias, whose squares make that of both."""
    if not isinstance(zero_sd_mm, int | float):
        return {"range_zero_sd_mm": None, "bias_sd_mm": None}
    both = sd_mm if isinstance(sd_mm, int | float) and sd_mm >= zero_sd_mm else None
    return {"range_zero_sd_mm": zero_sd_mm, "bias_sd_mm": None if both is None else math.sqrt(both**2 - zero_sd_mm**2)}


def comments_of(texts: Mapping[str, str]) -> list[str]:
    """Return the comments of a text that carry it, without the sign of a comment."""
    return [f"picoradar {name} {text}" for name, text in texts.items()]


def texts_in(comments: Iterable[str]) -> dict[str, str]:
    """Return the JSON texts by name that stand in comments; other comments are passed over."""
    found = (_COMMENT.fullmatch(comment.strip()) for comment in comments)
    return {match[1]: match[2] for match in found if match is not None}


def read_texts(texts: Mapping[str, str]) -> About:
    """Read what `texts_of` has written.

    Raises
    ------
    ValueError
        Naming what is wrong.
    """
    error, check = (_object(name, texts[name]) if name in texts else None for name in NAMES)
    return About(None if error is None else error_of(error), None if check is None else _check_of(check))


def error_of(content: Json) -> CommonError:
    """Return the common range error of a JSON object, as the header of a recording has it.

    Raises
    ------
    ValueError
        Naming what is wrong.
    """
    check_range_error(content)
    return CommonError(content.get("material", ""), content.get("bias_mm", 0.0), content.get("sd_mm"))


def _object(name: str, text: str) -> Json:
    content = parse_json(text)
    if not isinstance(content, dict):
        raise ValueError(f"its {name} is no JSON object")
    return content


def _check_of(content: Json) -> Json:
    found = {"by": "nothing"} | {name: content[name] for name in (*_WORDS, "sentence", *_FIGURES) if name in content}
    for name, words in _WORDS.items():
        if found.get(name) not in words:
            raise ValueError(f"{name} of its zero_check is {found.get(name)!r}, none of {', '.join(words)}")
    if not isinstance(found.get("sentence"), str):
        raise ValueError("its zero_check has no sentence")
    for name in _FIGURES:
        if not isinstance(found.get(name), int | float | None):
            raise ValueError(f"{name} of its zero_check is {found[name]!r}, neither a number nor null")
    return found
