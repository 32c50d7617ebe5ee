"""``picoradar resume``: go on with an interrupted recording, to the same result as without the interruption."""

from __future__ import annotations

import json as json_module
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picoradar.instrument.cli import options, output
from picoradar.instrument.errors import BadInput, Interrupted
from picoradar.instrument.events import JsonObject

if TYPE_CHECKING:
    from picoradar.instrument.settings import Settings


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(epilog="Example: picoradar resume scan.db")(resume)


def resume(
    recording: Annotated[Path, typer.Argument(help="Recording of a scan that was broken off.")],
    faults: options.Faults = None,
    speed: options.Speed = "max",
    yes: Annotated[
        bool, typer.Option("--yes", help="Do not ask before real devices are used; for programs that have checked it.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Take the lines that are missing, with the settings, seed and calibration of the recording itself.

    With real devices it first shows which ports, voltage and rate the recording names, and asks.
    """
    from picoradar.instrument.calibration import Calibration
    from picoradar.instrument.cli import scanning, session
    from picoradar.instrument.recording import Recording, refuse_unwritable
    from picoradar.instrument.settings import settings_from

    with Recording.open(recording) as broken_off:
        header = broken_off.header
        if broken_off.complete and all(line.ok for line in broken_off.check()):
            raise BadInput(f"{recording}: holds all its lines; there is nothing to go on with")
    settings = settings_from(header.get("settings"), str(recording))
    calibration = Calibration.from_json(json_module.dumps(header.get("calibration")), str(recording))
    refuse_unwritable(recording.parent)
    if settings.bench == "devices":
        ask_for_devices(settings, recording, agreed=yes)
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


def ask_for_devices(settings: Settings, recording: Path, *, agreed: bool) -> None:
    """Show what a recording would do with real devices, and go on only if a person agrees.

    A recording is a file that may come from anybody, and its settings say what is opened and how strong the laser is.

    Parameters
    ----------
    settings : Settings
        Of the recording's header.
    recording : Path
    agreed : bool
        The answer was given on the command line.

    Raises
    ------
    BadInput
        When there is nobody to ask.
    Interrupted
        When the answer is not yes; nothing was opened.
    """
    for line in _what_it_does(settings, recording):
        output.console().print(line, markup=False, soft_wrap=True)
    if agreed:
        return
    if sys.stdin is None or not sys.stdin.isatty():
        raise BadInput(
            f"{recording}: its settings name real devices, and there is no terminal to ask at; check what is shown "
            "above, then give --yes"
        )
    output.console().print("Go on with these devices? [y/N]", markup=False)
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise Interrupted(f"{recording}: not gone on with; no device was opened")


def _what_it_does(settings: Settings, recording: Path) -> list[str]:
    links, pulser = settings.links, settings.pulser
    temperature = links.tc200 if links.temperature == "tc200" else links.tec
    usb = f"{links.usb_backend} at {links.usb_address}" if links.usb_backend else "this computer's bus"
    power = ", ".join(f"{mw:g} mW at {volt:g} V and {rate:g} Hz" for volt, rate, mw in pulser.measured_output)
    return [
        f"{recording} names real devices, and its settings say:",
        f"  delay generator   {links.dg645}",
        f"  drive supply      {links.genesys}, address {links.genesys_address}",
        f"  temperature       {temperature}, {settings.diode.target_degc:g} degC",
        f"  USB devices       {usb}",
        f"  laser             {pulser.drive_v:g} V at {pulser.prf_hz:g} Hz; power by measurement {power}",
        f"  written to        {recording}",
    ]


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
