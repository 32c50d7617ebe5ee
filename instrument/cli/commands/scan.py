"""``picoradar scan``: one scan to a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picoradar.instrument.cli import options, output, transcripts
from picoradar.instrument.cli.commands import register as registering
from picoradar.instrument.cli.new_files import make_folder, refuse_taken
from picoradar.instrument.cli.register_options import LandmarksFile, TargetsFile, ToleranceOption
from picoradar.instrument.errors import BadInput
from picoradar.instrument.events import JsonObject

if TYPE_CHECKING:
    from picoradar.instrument.cli.following import Asked

DEFAULT_NAME = "scan.db"


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(
        epilog="Examples: picoradar scan --target prism -o prism.db\n\n"
        "picoradar scan --settings bench.toml --grid 60x60 --step-mm 0.5 --json\n\n"
        "picoradar scan --material bone -o bone.db\n\n"
        "picoradar scan --mode window --order interlaced --material bone --register hip.stl --until-tre 0.3 -o bone.db"
    )(scan)


def scan(
    settings: options.SettingsFile = None,
    target: options.Target = None,
    world: options.World = None,
    target_pose: options.TargetPose = None,
    distance_mm: options.DistanceMm = None,
    grid: options.Grid = None,
    step_mm: options.StepMm = None,
    averages: options.Averages = None,
    prf_hz: options.PrfHz = None,
    mode: options.Mode = None,
    order: options.Order = None,
    estimator: options.Estimator = None,
    material: options.Material = None,
    seed: options.Seed = None,
    faults: options.Faults = None,
    speed: options.Speed = "max",
    out: Annotated[Path | None, typer.Option("-o", help="Recording to make (a file that does not exist).")] = None,
    folder: Annotated[Path | None, typer.Option("--out", help="Folder for the recording, made if need be.")] = None,
    register: options.RegisterModel = None,
    targets: TargetsFile = None,
    landmarks: LandmarksFile = None,
    until_tre: options.UntilTre = None,
    tolerance: ToleranceOption = None,
    transcript: transcripts.TranscriptFile = None,
    json: options.Json = False,
) -> None:
    """Warm up, take one scan into a recording, and leave the laser verified off.

    With --register a pose is known after the first lines and refined after each; the scan ends as soon as it is good
    enough, and `picoradar resume` takes the rest of the raster.
    """
    from picoradar.instrument.cli import scanning, session

    wanted = options.scan_settings(
        settings,
        seed=seed,
        target=target,
        world=world,
        target_pose=target_pose,
        distance_mm=distance_mm,
        grid=grid,
        step_mm=step_mm,
        averages=averages,
        prf_hz=prf_hz,
        mode=mode,
        order=order,
        estimator=estimator,
        material=material,
    )
    path = recording_path(out, folder)
    asked = asked_registration(register, targets, landmarks, until_tre, tolerance)
    with (
        transcripts.transcript_to(transcript) as written,
        session.session(wanted, options.parse_speed(speed), written, faults=faults) as run,
    ):
        session.warm_up(run)
        result, outcome, _ = scanning.record_scan(run, path, asked)
    if json:
        output.print_json(result)
    else:
        output.print_table("scan", shown(result))
    rejected = asked is not None and result["registration"]["verdict"] == "fail"
    if rejected or not outcome.safe.laser_off_verified:
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)


def asked_registration(
    model: Path | None, targets: Path | None, landmarks: Path | None, until_tre: float | None, tolerance: str | None
) -> Asked | None:
    """Read what a scan is to be registered to; None without a model.

    Raises
    ------
    BadInput
        When a file cannot be used, or something is asked of a registration without one.
    """
    if model is None:
        given = {"--targets": targets, "--landmarks": landmarks, "--until-tre": until_tre, "--tolerance": tolerance}
        if left := [option for option, value in given.items() if value is not None]:
            raise BadInput(f"{', '.join(left)}: of a registration; name the model with --register MODEL, too")
        return None
    from picoradar.instrument.cli import following
    from picoradar.instrument.cli.register_inputs import read_start, read_targets

    return following.asked(
        model,
        {
            "start": read_start("any", landmarks),
            "targets": read_targets(targets),
            "tolerance": registering.parse_tolerance(tolerance),
        },
        until_tre,
    )


def shown(result: JsonObject) -> JsonObject:
    """Return what a table shows of a scan: of its registration the outcome, not every number."""
    if (found := result.get("registration")) is None:
        return result
    errors = "; ".join(
        f"{target['name']}: {'never measured' if (mm := target['tre_mm']) is None else f'{mm:.3f} mm'}"
        for target in found["targets"]
    )
    words = {
        "verdict": found["verdict"] + ": " + " ".join(found["reasons"]),
        "predicted error (rms)": errors,
        "reached": reached_in_words(found["live"]["reached_after_s"], len(found["lines_used"])),
    }
    return {**{key: value for key, value in result.items() if key != "registration"}, **words}


def reached_in_words(after_s: float | None, lines: int) -> str:
    """Say when a registration was good enough."""
    return (
        f"not before the end of {lines} lines" if after_s is None else f"{after_s:.1f} s after laser on, {lines} lines"
    )


def recording_path(out: Path | None, folder: Path | None) -> Path:
    """Choose where the recording goes, and make sure that it can be made there, before anything is switched.

    Raises
    ------
    BadInput
        When there is something already, or the folder cannot be made.
    RecordingError
        When no recording can be made in the folder.
    """
    path = out if out is not None else Path(DEFAULT_NAME)
    if folder is not None:
        if not (folder / path).resolve().is_relative_to(folder.resolve()):
            raise BadInput(f"-o {path}: leads out of the folder {folder}; give a name inside it, or no --out")
        path = folder / path
    refuse_taken(path, "give another name with -o")
    make_folder(path.parent, "give another one")
    return path
