"""``picoradar resume``: go on with an interrupted recording, to the same result as without the interruption."""

from __future__ import annotations

import json as json_module
from pathlib import Path
from typing import Annotated

import typer

from picoradar.instrument.cli import options, output
from picoradar.instrument.errors import BadInput
from picoradar.instrument.events import JsonObject


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(epilog="Example: picoradar resume scan.db")(resume)


def resume(
    recording: Annotated[Path, typer.Argument(help="Recording of a scan that was broken off.")],
    faults: options.Faults = None,
    speed: options.Speed = "max",
    json: options.Json = False,
) -> None:
    """Take the lines that are missing, with the settings, seed and calibration of the recording itself."""
    from picoradar.instrument.calibration import Calibration
    from picoradar.instrument.cli import scanning, session
    from picoradar.instrument.recording import Recording
    from picoradar.instrument.settings import settings_from

    with Recording.open(recording) as broken_off:
        header = broken_off.header
        if broken_off.complete and all(line.ok for line in broken_off.check()):
            raise BadInput(f"{recording}: holds all its lines; there is nothing to go on with")
    settings = settings_from(header.get("settings"), str(recording))
    calibration = Calibration.from_json(json_module.dumps(header.get("calibration")), str(recording))
    with session.session(settings, options.parse_speed(speed), faults=faults, calibration=calibration) as run:
        refuse_other_scanner(header, {name: str(identity) for name, identity in run.identities.items()}, recording)
        session.warm_up(run)
        result, outcome, _ = scanning.resume_scan(run, recording)
    if json:
        output.print_json(result)
    else:
        output.print_table("resume", result)
    if not outcome.safe.laser_off_verified:
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)


def refuse_other_scanner(header: JsonObject, found: dict[str, str], recording: Path) -> None:
    """Refuse to go on with other devices than those that the scan was begun with.

    Raises
    ------
    BadInput
        Naming the device that differs.
    """
    for name, before in (header.get("scanner") or {}).items():
        if found.get(name) != before:
            raise BadInput(
                f"{recording}: was begun with {name} {before}, now {found.get(name)} answers; "
                "go on with the same radar, or make a new scan"
            )
