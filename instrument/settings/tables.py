"""Settings of a bench: one TOML file, checked whole before anything is switched.

Every field carries its unit in the name, its range and a sentence, from which the commented file that a
user gets (`to_toml`) is written. What the simulator needs stays a plain table here: the simulator checks it.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from picoradar.drivers.interfaces import DRIVE_V, PRF_HZ
from picoradar.instrument.errors import BadInput
from picoradar.instrument.settings.limits import MAX_DISTANCE, MIN_DISTANCE, max_drive_v

RENAMED_BACKENDS = {"sim.usb.forward:backend": "picoradar.sim.usb.forward:backend"}
"""USB backends that settings and recordings of version 0.1 name, and what they are called now."""


class Section(BaseModel):
    """Common to all tables: unknown keys and silent conversions are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class Links(Section):
    """Where the devices are: ports by name or URL, USB devices by serial number."""

    dg645: str = Field("", description="serial port or URL of the delay generator")
    dg645_baud: int = Field(9600, ge=4800, le=115200, description="its baud rate")
    genesys: str = Field("", description="serial port or URL of the drive supply")
    genesys_baud: int = Field(9600, ge=1200, le=19200, description="its baud rate")
    genesys_address: int = Field(6, ge=0, le=30, description="its address")
    tec: str = Field("", description="serial port or URL of the temperature controller")
    tec_baud: int = Field(57600, ge=4800, le=1000000, description="its baud rate")
    tec_address: int = Field(1, ge=0, le=254, description="its address")
    bridge_serial: str = Field("", description="serial number of the sampling bridge; empty: the only one on the bus")
    sampler: Literal["bridge", "oscilloscope"] = Field(
        "bridge", description="what takes the traces; with the oscilloscope the bridge is the gate only"
    )
    oscilloscope_serial: str = Field("", description="serial number of the oscilloscope; empty: the only one there")
    usb_backend: str = Field("", description="module:function that makes a pyusb backend; empty: libusb")
    usb_address: str = Field("", description="argument of that function")
    speed: float = Field(1.0, gt=0, le=50, description="pace of a served simulated bench; real devices run at 1")

    @field_validator("usb_backend", mode="before")
    @classmethod
    def _renamed(cls, name: Any) -> Any:
        return RENAMED_BACKENDS.get(name, name) if isinstance(name, str) else name

    @model_validator(mode="after")
    def _real_devices_run_at_1(self) -> Links:
        if self.speed != 1.0 and not self.usb_backend:
            raise ValueError("speed is for the bench that `picoradar sim` serves; real devices run at speed 1")
        return self


class PulserSettings(Section):
    """Pulser of the laser diode."""

    prf_hz: float = Field(80_000.0, ge=PRF_HZ[0], le=PRF_HZ[1], description="pulse repetition frequency, Hz")
    drive_v: float = Field(290.0, ge=DRIVE_V[0], le=DRIVE_V[1], description="drive voltage, V")
    measured_output: tuple[tuple[float, float, float], ...] = Field(
        ((290.0, 80_000.0, 0.300), (330.0, 20_000.0, 0.103)),
        min_length=1,
        description="mean power measured at the exit: [drive V, rate Hz, mW], one entry a measurement",
    )
    output_margin: float = Field(
        1.2, ge=1, le=10, description="factor on the measured energy: uncertainty of the power meter, temperature"
    )

    @field_validator("measured_output", mode="before")
    @classmethod
    def _lists_are_tuples(cls, points: Any) -> Any:  # TOML and JSON know lists only
        if not isinstance(points, list):
            return points
        return tuple(tuple(point) if isinstance(point, list) else point for point in points)

    @field_validator("measured_output")
    @classmethod
    def _positive(cls, points: tuple[tuple[float, float, float], ...]) -> tuple[tuple[float, float, float], ...]:
        if not all(value > 0 for point in points for value in point):
            raise ValueError("drive voltage, rate and mean power of each measurement must be above 0")
        return points

    @model_validator(mode="after")
    def _no_overheating(self) -> PulserSettings:
        limit_v = max_drive_v(self.prf_hz)
        if self.drive_v > limit_v:
            raise ValueError(
                f"drive_v {self.drive_v:g} V overheats the transmitter at {self.prf_hz:g} Hz; at most {limit_v:.0f} V"
            )
        return self


class DiodeSettings(Section):
    """Temperature of the laser diode."""

    target_degc: float = Field(23.0, ge=17, le=25, description="target temperature, degC")
    warm_up_limit_s: float = Field(1800.0, ge=10, le=7200, description="longest warm-up before it counts as failed, s")
    settled_k: float = Field(
        0.004,
        gt=0,
        le=0.2,
        description="lines are taken once the diode, with the laser on, is as near to its target, K",
    )
    settle_limit_s: float = Field(
        60.0, ge=0, le=600, description="longest wait for that; then it is noted and goes on, s"
    )


class SamplerSettings(Section):
    """How one trace is sampled."""

    start_ps: float = Field(6500.0, ge=0, le=100_000, description="first sampling instant after the trigger, ps")
    step_ps: float = Field(6.7, ge=1, le=100, description="step from shot to shot, ps (6.7 ps is 1 mm of range)")
    samples: int = Field(1430, ge=100, le=16384, description="samples in a sweep")
    reference_ps: float = Field(
        7400.0, ge=0, le=100_000, description="place of the reference pulse on the trace (+-1000 ps), ps"
    )
    settle_shots: int = Field(16, ge=0, le=1000, description="shots thrown away before each sweep")


class ScannerSettings(Section):
    """Galvo scanner as the instrument drives it."""

    field_deg: float = Field(10.0, gt=0, le=40, description="full analogue span of the 4096 codes, optical degrees")
    settle_ms: float = Field(3.0, ge=0, le=1000, description="wait after a step within a line, ms")
    flyback_settle_ms: float = Field(25.0, ge=0, le=1000, description="wait after the step to a new line, ms")
    window_settle_ms: float = Field(
        1.2, ge=0, le=100, description="window mode: least time from a step to the first shot on the echo, ms"
    )
    window_flyback_ms: float = Field(12.0, ge=0, le=1000, description="window mode: wait after the step to a new line")
    window_settle_shots: int = Field(2, ge=0, le=1000, description="window mode: shots thrown away before each sweep")


class ScanSettings(Section):
    """The raster and how each of its points is taken."""

    rows: int = Field(40, ge=1, le=1000, description="lines of the raster")
    columns: int = Field(40, ge=1, le=1000, description="points in a line")
    step_mm: float = Field(
        1.0, gt=0, le=20, description="distance of neighbouring points on the plane at distance_mm, mm"
    )
    distance_mm: float = Field(
        900.0,
        ge=MIN_DISTANCE.value,
        le=MAX_DISTANCE.value,
        description=f"distance of that plane, mm (below {MIN_DISTANCE.value:g} reference and echo overlap)",
    )
    averages: int = Field(8, ge=1, le=64, description="sweeps averaged into one record")
    mode: Literal["sweep", "window"] = Field(
        "sweep", description="sweep: the whole trace at every point; window: two short pieces of it, just enough shots"
    )
    estimator: Literal["half-maximum", "template"] = Field(
        "half-maximum", description="how a trace becomes a range (window mode always uses template)"
    )
    wanted_sd_mm: float = Field(
        0.22, gt=0, le=10, description="window mode: standard deviation that each range is to have"
    )
    keep_traces: bool = Field(True, description="keep the raw traces in the recording")


class Settings(Section):
    """Everything that a scan needs to know."""

    bench: Literal["simulated", "devices"] = Field(
        "simulated", description="simulated: everything in this process; devices: over [links]"
    )
    seed: int = Field(1, ge=0, description="root seed of the simulated bench")
    calibration: str = Field("", description="calibration file; empty: the one that comes with the simulated bench")
    links: Links = Links()
    pulser: PulserSettings = PulserSettings()
    diode: DiodeSettings = DiodeSettings()
    sampler: SamplerSettings = SamplerSettings()
    scanner: ScannerSettings = ScannerSettings()
    scan: ScanSettings = ScanSettings()
    simulation: dict[str, Any] = Field(default_factory=dict, description="what the simulated bench is made of")


def load_settings(path: Path) -> Settings:
    """Read and check a settings file.

    Raises
    ------
    BadInput
        With the file, the line, the key, the value and what is allowed.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(
            f"{path}: cannot read the settings: {error}; give a TOML file (picoradar demo writes one)"
        ) from error
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{path}: not valid TOML: {error}; mend that line") from error
    return settings_from(table, str(path), text)


def settings_from(table: object, source: str, text: str = "") -> Settings:
    """Check settings given as a table, as a recording carries them; ``source`` and ``text`` are for messages.

    Raises
    ------
    BadInput
    """
    try:
        return Settings.model_validate(table)
    except ValidationError as error:
        raise BadInput("; ".join(describe_errors(error, source, text))) from error


def override(settings: Settings, changes: Mapping[str, Mapping[str, Any]]) -> Settings:
    """Return settings with some values replaced, checked again.

    Parameters
    ----------
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
    """Say for each finding: file and line, key, value, what is allowed."""
    for finding in error.errors(include_url=False):
        keys = [str(k) for k in finding["loc"]]
        line = _line_of(text, keys)
        where = f"{source}, line {line}" if line else source
        value = finding.get("input")
        shown = "" if isinstance(value, (dict, Section)) or value is None else f" = {value!r}"
        message = finding["msg"].removeprefix("Value error, ")
        if finding["type"] == "extra_forbidden":
            message = "unknown key; take it out or mend its spelling"
        yield f"{where}: {'.'.join(keys) or 'settings'}{shown}: {message}"


def _line_of(text: str, keys: list[str]) -> int:
    """Find the line of a key in TOML text; 0 when it is not written there."""
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


def to_toml(settings: Settings, simulation: BaseModel | None = None) -> str:
    """Write settings as a commented TOML file, each line with what it means.

    Parameters
    ----------
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


def _toml_line(key: str, value: Any, description: str | None) -> str:
    comment = f"  # {description}" if description else ""
    if value is None:
        return f"# {key} ={comment}"
    return f"{key} = {_toml_value(value)}{comment}"


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml_value(v) for v in value) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)
