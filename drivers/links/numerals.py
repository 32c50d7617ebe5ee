"""Numbers in ASCII replies, read strictly."""

from __future__ import annotations

import math
import re

LONGEST = 40
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(E[+-]?\d{1,3})?", re.ASCII | re.IGNORECASE)


def read_number(text: str) -> float:
    """Read a decimal number.

    Unlike ``float`` it accepts no underscores, foreign digits, infinities or NaN: what no instrument
    sends must not pass for a measured value.

    Raises
    ------
    ValueError
        When the text is not a plain decimal number.
    """
    if len(text) > LONGEST or not _NUMBER.fullmatch(text) or not math.isfinite(value := float(text)):
        raise ValueError(f"{text!r} is no number")
    return value
