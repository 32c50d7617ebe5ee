"""``picoradar scan``: one scan to a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from picoradar.instrument.cli import options, output, transcripts
from picoradar.instrument.cli.new_files import make_folder, refuse_taken
from picoradar.instrument.errors import BadInput

DEFAULT_NAME = "scan.db"


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(
        epilog="Examples: picoradar scan --target prism -o prism.db\n\n"
        "picoradar scan --settings bench.toml --grid 60x60 --step-mm 0.5 --json\n\n"
        "picoradar scan --material bone -o bone.db"
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
    estimator: options.Estimator = None,
    material: options.Material = None,
    seed: options.Seed = None,
    faults: options.Faults = None,
    speed: options.Speed = "max",
    out: Annotated[Path | None, typer.Option("-o", help="Recording to make (a file that does not exist).")] = None,
    folder: Annotated[Path | None, typer.Option("--out", help="Folder for the recording, made if need be.")] = None,
    transcript: transcripts.TranscriptFile = None,
    json: options.Json = False,
) -> None:
    """Warm up, take one scan into a recording, and leave the laser verified off."""
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
        estimator=estimator,
        material=material,
    )
    path = recording_path(out, folder)
    with (
        transcripts.transcript_to(transcript) as written,
        session.session(wanted, options.parse_speed(speed), written, faults=faults) as run,
    ):
        session.warm_up(run)
        result, outcome, _ = scanning.record_scan(run, path)
    if json:
        output.print_json(result)
    else:
        output.print_table("scan", result)
    if not outcome.safe.laser_off_verified:
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)


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
