"""``picoradar info``: the content of a recording, checked line by line."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from picoradar.instrument.cli import output
from picoradar.instrument.cli.options import Json

if TYPE_CHECKING:
    from picoradar.instrument.recording import Recording


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(epilog="Examples: picoradar info scan.db\n\npicoradar info --salvage damaged.db")(info)


def info(
    recording: Annotated[Path, typer.Argument(help="Recording of a scan.")],
    salvage: Annotated[
        bool, typer.Option("--salvage", help="Copy what still reads of a damaged recording into a new one beside it.")
    ] = False,
    json: Json = False,
) -> None:
    """Show what is in a recording, and check every line of it."""
    from picoradar.instrument import recording as recordings
    from picoradar.instrument.recording import Recording

    if salvage:
        new, kept, lost = recordings.salvage(recording)
        if json:
            output.print_json({"salvaged": str(new), "kept": kept, "lost": lost})
        else:
            rest = f"picoradar resume {new} takes the others" if lost else "nothing is missing"
            output.print_table(
                "salvage", {"recording": new, "lines kept": len(kept), "lines lost": len(lost), "next": rest}
            )
        return
    with Recording.open(recording) as scan:
        result = describe_recording(scan)
    bad = cast("list[dict[str, object]]", result["damaged"])
    if json:
        output.print_json(result)
    else:
        shown = ("lines", "lines_ok", "complete", "stop_reason", "seed", "raster", "range_error", "scanner", "versions")
        words = {
            "two echoes": f"told apart at {result['two_echoes']} places",
            "range zero": zero_words(result),
            "registration": registration_words(result),
        }
        output.print_table(str(recording), {**{k: result[k] for k in shown}, **words})
        for line in bad:
            output.console().print(f"line {line['line']}: {line['problem']}")
    if bad:
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)


def zero_words(described: Mapping[str, object]) -> str:
    """Return what the check of the range zero has found, in words."""
    return str(cast("dict[str, object]", described["zero_check"])["sentence"])


def registration_words(described: Mapping[str, object]) -> str:
    """Return what was registered while the scan was made, in words."""
    found = cast("dict[str, object] | None", described["registration"])
    if found is None:
        return "none while it was made; picoradar register makes one"
    reasons = " ".join(cast("list[str]", found["reasons"]))
    return f"{found['verdict']}, of {found['lines_recorded']} lines, to {found['model']}: {reasons}"


def describe_recording(scan: Recording) -> dict[str, object]:
    """Describe a recording by the keys of the command's contract; every line is checked."""
    from picoradar.instrument.acquisition import zero_check_of
    from picoradar.instrument.recording import range_error_in

    checks, header, cloud = scan.check(), scan.header, scan.cloud(skip_damaged=True)
    damaged = [{"line": line.index, "problem": line.problem} for line in checks if not line.ok]
    return {
        "lines": len(checks),
        "lines_ok": len(checks) - len(damaged),
        "complete": scan.complete,
        "settings": header.get("settings"),
        "calibration": header.get("calibration"),
        "seed": header.get("seed"),
        "stop_reason": scan.stop_reason,
        "raster": header.get("raster"),
        "range_error": range_error_in(header, cloud) or None,
        "versions": header.get("versions"),
        "scanner": header.get("scanner"),
        "two_echoes": int(cloud.with_range().two_echoes.sum()),
        "zero_check": zero_check_of(scan).to_dict(),
        "registration": next(reversed(scan.registrations()), None),
        "damaged": damaged,
    }
