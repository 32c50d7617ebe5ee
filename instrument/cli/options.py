"""Options that several subcommands share, and how they change the settings."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict, Unpack

import typer

from picoradar.instrument.errors import BadInput

if TYPE_CHECKING:
    from picoradar.instrument.settings import Settings

MAX_COORDINATE = 1e5  # mm or degrees; nothing on the bench is farther away

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]
Seed = Annotated[int | None, typer.Option(help="Root seed of the simulated bench: same seed, same data.", min=0)]
SettingsFile = Annotated[
    Path | None,
    typer.Option(
        "--settings",
        help="Settings file (TOML); without it the built-in simulated bench.",
    ),
]
Target = Annotated[
    str | None,
    typer.Option(
        help="hip, prism, gray, plate, step, sphere, coated (half of it painted) or a mesh (simulated bench)."
    ),
]
World = Annotated[
    str | None,
    typer.Option(help="dissertation, or clinic with hum, 1/f noise, speckle, light in tissue (simulated bench)."),
]
TargetPose = Annotated[
    str | None, typer.Option(help="Pose of the target: x,y,z,rx,ry,rz in mm and degrees (simulated bench).")
]
DistanceMm = Annotated[float | None, typer.Option(help="Distance of the raster's plane, mm.")]
Grid = Annotated[str | None, typer.Option(help="Raster as ROWSxCOLUMNS, for example 40x40.")]
StepMm = Annotated[float | None, typer.Option(help="Distance of neighbouring points, mm.")]
Averages = Annotated[int | None, typer.Option(help="Sweeps averaged into one record.")]
PrfHz = Annotated[float | None, typer.Option(help="Pulse repetition frequency, Hz.")]
Mode = Annotated[
    str | None, typer.Option(help="sweep: the whole trace; window: two short pieces, only the shots needed.")
]
Order = Annotated[
    str | None,
    typer.Option(help="Order of the lines: rows, or interlaced (every 16th line, then those between)."),
]
Estimator = Annotated[str | None, typer.Option(help="How a trace becomes a range: half-maximum or template.")]
RegisterModel = Annotated[
    Path | None,
    typer.Option(
        "--register", help="Mesh (mm) to register to while the scan is made; it ends once the verdict is pass."
    ),
]
UntilTre = Annotated[
    float | None, typer.Option("--until-tre", help="End at pass and this predicted error (rms, mm) at every target.")
]
Material = Annotated[
    str | None,
    typer.Option(
        help="What is scanned: bone, cartilage, ... as measured by bench penetration; its range error is taken off."
    ),
]
Faults = Annotated[
    Path | None, typer.Option("--faults", help="Faults to inject into the simulated bench (TOML or JSON).")
]
Speed = Annotated[str, typer.Option(help="Pace of the simulated bench: max, 1 (real time) or a factor.")]


class ScanOptions(TypedDict, total=False):
    """Options of the command line that change the settings; None and a missing option change nothing."""

    seed: int | None
    target: str | None
    world: str | None
    target_pose: str | None
    distance_mm: float | None
    grid: str | None
    step_mm: float | None
    averages: int | None
    prf_hz: float | None
    mode: str | None
    order: str | None
    estimator: str | None
    material: str | None


def scan_settings(settings_file: Path | None, **options: Unpack[ScanOptions]) -> Settings:
    """Read the settings file, if any; options of the command line take precedence over it.

    Parameters
    ----------
    settings_file : path, optional
        Without it the built-in simulated bench.
    **options : ScanOptions

    Raises
    ------
    BadInput
        Naming file or option, value and what is allowed.
    """
    from picoradar.instrument.settings import Settings, load_settings, override  # here, because they make --help slow

    settings = Settings() if settings_file is None else load_settings(settings_file)
    grid, target, distance_mm = options.get("grid"), options.get("target"), options.get("distance_mm")
    world = options.get("world")
    rows, columns = parse_grid(grid) if grid is not None else (None, None)
    pose = parse_pose(options.get("target_pose"))
    if settings.bench != "simulated" and (target or pose or world):
        raise BadInput(
            "--target, --target-pose and --world are of the simulated bench; this settings file has real devices"
        )
    return override(
        settings,
        {
            "": {"seed": options.get("seed")},
            "pulser": {"prf_hz": options.get("prf_hz")},
            "scan": {
                "rows": rows,
                "columns": columns,
                "step_mm": options.get("step_mm"),
                "distance_mm": distance_mm,
                "averages": options.get("averages"),
                "mode": options.get("mode"),
                "order": options.get("order"),
                "estimator": options.get("estimator"),
                "material": options.get("material"),
            },
            "simulation": {"target": target, "target_pose": pose, "distance_mm": distance_mm, "world": world}
            if settings.bench == "simulated"
            else {},
        },
    )


def parse_grid(text: str) -> tuple[int, int]:
    """Read ``40x40`` as rows and columns.

    Raises
    ------
    BadInput
    """
    match = re.fullmatch(r"\s*(\d+)\s*[xX×]\s*(\d+)\s*", text)
    if match is None:
        raise BadInput(f"--grid {text!r}: not ROWSxCOLUMNS; write for example --grid 40x40")
    return int(match[1]), int(match[2])


def parse_pose(text: str | None) -> list[float] | None:
    """Read ``x,y,z,rx,ry,rz`` (mm, degrees).

    Raises
    ------
    BadInput
    """
    return None if text is None else parse_numbers(text, 6, "--target-pose", "x,y,z,rx,ry,rz in mm and degrees")


def checked_material(name: str | None) -> str | None:
    """Check the name of a material as the settings do; None stays None.

    Raises
    ------
    BadInput
    """
    from picoradar.instrument.settings import Settings, override

    return None if name is None else override(Settings(), {"scan": {"material": name}}).scan.material


def parse_numbers(text: str, count: int, option: str, form: str) -> list[float]:
    """Read ``count`` numbers separated by commas.

    Parameters
    ----------
    text : str
        Value of the option.
    count : int
        Number of numbers.
    option, form : str
        Name of the option and the expected form, for messages.

    Raises
    ------
    BadInput
    """
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count:
        raise BadInput(f"{option} {text!r}: not {count} numbers; give {form}")
    if not all(abs(n) <= MAX_COORDINATE for n in numbers):  # also true for NaN
        raise BadInput(f"{option} {text!r}: each number must lie within +-{MAX_COORDINATE:g}; give {form}")
    return numbers


def parse_speed(text: str) -> float | None:
    """Read ``max`` (None) or a positive factor.

    Raises
    ------
    BadInput
    """
    if text == "max":
        return None
    try:
        factor = float(text)
    except ValueError:
        factor = 0.0
    if not 0 < factor < float("inf"):
        raise BadInput(f"--speed {text!r}: give max, 1 or a positive factor")
    return factor
