"""What a decoder may raise on a file of unknown origin, and JSON and TOML read within limits.

Every reader above the drivers catches `DECODER_ERRORS` and refuses in words; the list stands here and nowhere else
(`picoradar.registration`, which imports nothing of the rest, has its own in its errors).
"""

from __future__ import annotations

import json
import struct
import tokenize
import tomllib
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

DECODER_ERRORS: tuple[type[Exception], ...] = (
    ValueError,  # also JSON, TOML, UTF-8, base64, integers of more than 4300 digits
    TypeError,
    AttributeError,  # as TypeError: a list where a table should be
    LookupError,
    ArithmeticError,  # OverflowError: a number that its field does not hold
    EOFError,
    MemoryError,
    RuntimeError,  # also RecursionError, and what zipfile does not implement
    SyntaxError,  # headers of NumPy arrays
    struct.error,
    tokenize.TokenError,  # headers of NumPy arrays, too
    zipfile.BadZipFile,
    zlib.error,
)
"""Exceptions of decoders (json, tomllib, struct, zlib, zipfile, NumPy) on damaged or hostile content."""

LARGEST_TEXT_BYTES = 64_000_000
"""Longest JSON or TOML file that is read, bytes; a calibration with templates has about 100 kB."""

DEEPEST = 32
"""Most tables and lists inside each other; a recording's header has 6."""

LARGEST_INTEGER = 2**63 - 1
"""Largest whole number: what SQLite, HDF5 and most programs can keep."""


def decoder_words(error: BaseException) -> str:
    """Say what a decoder found; some exceptions have no words of their own."""
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, MemoryError):
        return "it needs more memory than there is"
    return " ".join(str(error).split())[:300] or type(error).__name__


def read_text(path: Path, largest_bytes: int = LARGEST_TEXT_BYTES) -> str:
    """Read a UTF-8 file that is not larger than allowed.

    Raises
    ------
    OSError
        If it cannot be read.
    ValueError
        If it is too large, or not UTF-8.
    """
    with path.open("rb") as file:
        content = file.read(largest_bytes + 1)
    if len(content) > largest_bytes:
        raise ValueError(f"it is larger than {largest_bytes} bytes")
    return content.decode("utf-8")


def parse_json(text: str | bytes | bytearray) -> object:
    """Read JSON: whole numbers of 64 bits, not nested too deeply. NaN is left to who knows the value's name.

    Raises
    ------
    ValueError
        In words, whatever is wrong.
    """
    return _parsed(lambda: json.loads(text))


def parse_toml(text: str) -> dict[str, object]:
    """Read TOML within the same limits.

    Raises
    ------
    ValueError
        In words, whatever is wrong.
    """
    table = _parsed(lambda: tomllib.loads(text))
    return table if isinstance(table, dict) else {}


def _parsed(parse: Callable[[], object]) -> object:
    try:
        content = parse()
    except DECODER_ERRORS as error:
        raise ValueError(decoder_words(error)) from error
    _check(content)
    return content


def _check(content: object) -> None:
    """Check depth and numbers; level by level, since recursion is what deep nesting breaks."""
    level = [content]
    for _ in range(DEEPEST + 1):
        deeper: list[object] = []
        for value in level:
            if isinstance(value, dict):
                deeper += value.values()
            elif isinstance(value, list):
                deeper += value
            elif isinstance(value, int) and abs(value) > LARGEST_INTEGER:
                raise ValueError("a whole number in it has more than 64 bits")
        if not deeper:
            return
        level = deeper
    raise ValueError(f"it is nested deeper than {DEEPEST}")
