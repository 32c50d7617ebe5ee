"""Scenario files: a list of faults in TOML (``[[fault]]``) or JSON (``{"fault": [...]}``)."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from picoradar.drivers.errors import parse_json, parse_toml, read_text
from picoradar.sim.faults.fault import Fault
from picoradar.sim.faults.kinds import KINDS


def load_scenario(path: Path) -> list[Fault]:
    """Read and check a scenario file.

    Raises
    ------
    ValueError
        With the file, the number of the fault, the key and what is allowed.
    """
    try:
        text = read_text(path)
        table = parse_json(text) if path.suffix == ".json" else parse_toml(text)
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: cannot be read as faults: {error}; give TOML with [[fault]] or JSON") from error
    if not isinstance(table, dict) or set(table) != {"fault"} or not isinstance(table["fault"], list):
        raise ValueError(f"{path}: holds no list of faults; write [[fault]] tables and nothing else")
    return [checked(entry, f"{path}, fault {number}") for number, entry in enumerate(table["fault"], 1)]


def checked(entry: object, where: str) -> Fault:
    """Check one declaration against the kinds.

    Parameters
    ----------
    entry : object
        As read from the file.
    where : str
        File and number of the fault, for messages.

    Raises
    ------
    ValueError
    """
    try:
        fault = Fault.model_validate(entry)
    except ValidationError as error:
        found = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors(include_url=False))
        raise ValueError(f"{where}: {found}") from error
    kind = KINDS.get(fault.kind)
    if kind is None:
        raise ValueError(f"{where}: kind {fault.kind!r} is not known; known are {', '.join(sorted(KINDS))}")
    if fault.link not in kind.links:
        raise ValueError(f"{where}: {fault.kind} happens on {', '.join(kind.links)}, not on {fault.link}")
    if unknown := set(fault.parameters) - set(kind.defaults):
        allowed = ", ".join(kind.defaults) or "none"
        raise ValueError(f"{where}: {fault.kind} has no parameter {', '.join(sorted(unknown))}; it has {allowed}")
    return fault
