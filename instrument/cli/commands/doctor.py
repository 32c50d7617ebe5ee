"""``picoradar doctor``: opens and identifies every device, says what is wrong and what to do; the laser stays off."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picoradar.instrument.cli import options, output, transcripts

if TYPE_CHECKING:
    from picoradar.instrument.bench import DeviceMaker, Finding
    from picoradar.instrument.settings import Settings


SHOWN_INCIDENTS = 5


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(epilog="Examples: picoradar doctor --settings bench.toml\n\npicoradar doctor --json")(doctor)


def doctor(
    settings: options.SettingsFile = None,
    acknowledge: Annotated[
        bool,
        typer.Option("--acknowledge", help="Unlock the bridge's gate and reset the TEC's error, causes removed."),
    ] = False,
    interlock: Annotated[
        bool,
        typer.Option("--interlock", help="Wait for the interlock to be opened by hand; bridge and supply must see it."),
    ] = False,
    transcript: transcripts.TranscriptFile = None,
    json: options.Json = False,
) -> None:
    """Open and identify every device, check limits and permissions; the laser stays off."""
    from picoradar.instrument import events
    from picoradar.instrument.bench import check_interlock, examine
    from picoradar.instrument.settings import Settings, load_settings

    wanted = Settings() if settings is None else load_settings(settings)
    with _maker(wanted, transcript) as (make, hand):
        found = list(_shown(examine(wanted, make, acknowledge=acknowledge), quiet=json))
        if interlock and all(f.ok for f in found):
            found += _shown(check_interlock(make, hand), quiet=json)
    past = events.last_incidents(SHOWN_INCIDENTS)
    if json:
        rows = [
            {
                "name": f.name,
                "identity": f.identity or None,
                "link": f.link,
                "ok": f.ok,
                "problem": f.problem or None,
                "found_on": list(f.found_on),
            }
            for f in found
        ]
        logged = {"file": str(events.log_file()), "last": past}
        output.print_json({"devices": rows, "ok": all(f.ok for f in found), "incidents": logged})
    elif past:
        output.console().print(f"last incidents, from {events.log_file()}:", soft_wrap=True)
        for incident in past:
            what = " ".join(str(incident.get(key, "")) for key in ("time", "level", "event", "cause", "error"))
            output.console().print(f"  {what.strip()}", soft_wrap=True, markup=False)
    if not all(f.ok for f in found):
        raise typer.Exit(output.EXIT_DEVICE)


@contextmanager
def _maker(settings: Settings, transcript: Path | None) -> Iterator[tuple[DeviceMaker, Callable[[str], None]]]:
    """Make the maker of the devices, real or simulated, and what tells the person at the interlock what to do."""
    from picoradar.drivers.clock import ScaledClock
    from picoradar.instrument.bench import DeviceMaker

    with transcripts.transcript_to(transcript) as written:
        if settings.bench == "devices":
            tell = output.console().print
            yield DeviceMaker(settings.links, ScaledClock(settings.links.speed), transcript=written), tell
            return
        from picoradar.instrument.cli.simulated import Simulated

        simulated = Simulated(settings, None)
        try:
            make = DeviceMaker(simulated.links, simulated.clock, simulated.usb_backend, written)
            yield make, simulated.move_interlock
        finally:
            simulated.close()


def _shown(findings: Iterator[Finding], *, quiet: bool) -> Iterator[Finding]:
    """Show each finding to people as soon as it is there."""
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False)
    for finding in findings:
        if not quiet:
            mark = Text("ok  ", "green") if finding.ok else Text("FAIL", "bold red")
            who = finding.identity or "no answer"
            console.print(mark, f"{finding.name:8} {who}  ({finding.link})", soft_wrap=True)
            if finding.found_on:
                console.print(f"       was on: {', '.join(finding.found_on)}; switched off now", markup=False)
            if finding.problem:
                console.print(f"       {finding.problem}", soft_wrap=True, markup=False)
        yield finding
