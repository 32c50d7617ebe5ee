"""Reading and checking settings: from a TOML file, from a recording, with options of the command line on top."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from pydantic import ValidationError

from picoradar.drivers.errors import parse_toml, read_text
from picoradar.instrument.errors import BadInput
from picoradar.instrument.settings.tables import Section, Settings

LONGEST_SHOWN = 200
"""Characters of a wrong value in a message."""


def load_settings(path: Path) -> Settings:
    """Read and check a settings file.

    Raises
    ------
    BadInput
        With the file, the line, the key, the value and what is allowed.
    """
    try:
        text = read_text(path)
    except (OSError, ValueError) as error:
        raise BadInput(
            f"{path}: cannot read the settings: {error}; give a TOML file (picoradar demo writes one)"
        ) from error
    try:
        table = parse_toml(text)
    except ValueError as error:
        raise BadInput(f"{path}: not valid TOML: {error}; correct that line") from error
    return settings_from(table, str(path), text)


def settings_from(table: object, source: str, text: str = "") -> Settings:
    """Check settings given as a table, as in the header of a recording.

    Parameters
    ----------
    table : object
        What was read.
    source, text : str
        Where it comes from, and its TOML text if there is one; for the messages.

    Raises
    ------
    BadInput
        With the source, the key, the value and what is allowed.
    """
    try:
        return Settings.model_validate(table)
    except ValidationError as error:
        raise BadInput("; ".join(describe_errors(error, source, text))) from error


def override(settings: Settings, changes: Mapping[str, Mapping[str, object]]) -> Settings:
    """Return settings with some values replaced, checked again.

    Parameters
    ----------
    settings : Settings
    changes : mapping of table name to mapping of key to value
        The empty name stands for the top table. Values that are None are left as they are.

    Raises
    ------
    BadInput
        When the result is not allowed.
    """
    table = settings.model_dump()
    for name, values in changes.items():
        into = table[name] if name else table
        into.update({k: v for k, v in values.items() if v is not None})
    try:
        return Settings.model_validate(table)
    except ValidationError as error:
        raise BadInput("; ".join(describe_errors(error, "options", ""))) from error


def describe_errors(error: ValidationError, source: str, text: str) -> Iterator[str]:
    """Describe each error of a validation: file and line, key, value and what is allowed."""
    for finding in error.errors(include_url=False):
        keys = [str(k) for k in finding["loc"]]
        line = _line_of(text, keys)
        where = f"{source}, line {line}" if line else source
        value = finding.get("input")
        shown = "" if isinstance(value, (dict, Section)) or value is None else f" = {_short(value)}"
        message = finding["msg"].removeprefix("Value error, ")
        if finding["type"] == "extra_forbidden":
            message = "unknown key; remove it or correct its spelling"
        yield f"{where}: {'.'.join(keys) or 'settings'}{shown}: {message}"


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def _line_of(text: str, keys: list[str]) -> int:
    """Find the line of a key in TOML text; 0 when it is not there."""
    if not text or not keys:
        return 0
    table, wanted, here = keys[:-1], keys[-1], []
    for number, line in enumerate(text.splitlines(), 1):
        if header := re.match(r"\s*\[\s*([^\]]+?)\s*\]", line):
            here = [k.strip().strip('"') for k in header[1].split(".")]
            if here == keys:
                return number
        elif here == table and re.match(rf'\s*"?{re.escape(wanted)}"?\s*=', line):
            return number
    return 0
