"""Settings as a commented TOML file."""

from __future__ import annotations

from pydantic import BaseModel

from picoradar.instrument.settings.tables import Settings


def to_toml(settings: Settings, simulation: BaseModel | None = None) -> str:
    """Write settings as a commented TOML file, each line with its meaning.

    Parameters
    ----------
    settings : Settings
    simulation : pydantic model, optional
        The simulator's checked form of ``settings.simulation``, written with its own comments.
    """
    out = ["# Settings of picoradar. Edit and use with: picoradar scan --settings FILE", ""]
    tables: list[tuple[str, BaseModel]] = []
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if isinstance(value, BaseModel):
            tables.append((name, value))
        elif not isinstance(value, dict):
            out.append(_toml_line(name, value, field.description))
    if simulation is not None:
        tables.append(("simulation", simulation))
    for name, table in tables:
        doc = (type(table).__doc__ or "").strip().splitlines()
        out += ["", f"# {doc[0]}" if doc else "#", f"[{name}]"]
        for key, field in type(table).model_fields.items():
            out.append(_toml_line(key, getattr(table, key), field.description))
    return "\n".join(out) + "\n"


def _toml_line(key: str, value: object, description: str | None) -> str:
    comment = f"  # {description}" if description else ""
    if value is None:
        return f"# {key} ={comment}"
    return f"{key} = {_toml_value(value)}{comment}"


def _toml_value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml_value(v) for v in value) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)
