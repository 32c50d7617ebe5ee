"""``picoradar calibration``: list, show and compare calibrations, and say which is in force."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picoradar.instrument.cli import options, output
from picoradar.instrument.errors import BadInput

if TYPE_CHECKING:
    from picoradar.instrument.calibration import Calibration, Material, Ranging
    from picoradar.instrument.settings import Settings

Files = Annotated[list[Path] | None, typer.Argument(help="Calibration files, or folders to search; none: this folder.")]
File = Annotated[Path, typer.Argument(help="A calibration file.")]

calibration = typer.Typer(
    help="Show calibration files, and the one in force.", no_args_is_help=True, rich_markup_mode=None
)


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.add_typer(calibration, name="calibration")


@calibration.command("list", epilog="Example: picoradar calibration list gray geometry")
def listed(files: Files = None, json: options.Json = False) -> None:
    """List calibrations, the newest first.

    Files that are not calibrations are named on stderr.
    """
    from picoradar.instrument.calibration import Calibration

    found: list[tuple[Path, Calibration]] = []
    for path in _candidates(files or [Path()]):
        try:
            found.append((path, Calibration.load(path)))
        except BadInput as error:
            output.console().print(f"left out: {error}", markup=False)
    found.sort(key=lambda pair: pair[1].date, reverse=True)
    rows = [{"file": path, **_summary(one)} for path, one in found]
    if json:
        output.print_json({"calibrations": rows})
    else:
        output.print_table(
            f"{len(rows)} calibrations", {str(row["file"]): f"{row['date']}  {row['provenance']}" for row in rows}
        )


@calibration.command(epilog="Example: picoradar calibration show gray/calibration.json")
def show(file: File, json: options.Json = False) -> None:
    """Show what a calibration contains."""
    from picoradar.instrument.calibration import Calibration

    summary = {"file": file, **_summary(Calibration.load(file))}
    if json:
        output.print_json(summary)
    else:
        output.print_table(str(file), summary)


@calibration.command(epilog="Example: picoradar calibration compare old.json new.json")
def compare(before: File, after: File, json: options.Json = False) -> None:
    """Show how two calibrations differ.

    The second minus the first: their values, the effect in millimetres at a point of the scan, and whether both are of
    the same instrument.
    """
    from picoradar.instrument.calibration import Calibration, differences

    found = differences(Calibration.load(before), Calibration.load(after))
    if json:
        output.print_json({"before": before, "after": after, **found})
    else:
        output.print_table(f"{after} minus {before}", found)


@calibration.command(epilog="Example: picoradar calibration status --settings bench.toml")
def status(settings: options.SettingsFile = None, json: options.Json = False) -> None:
    """Show which calibration is in force, and whether it is out of date.

    Criteria: serial numbers of the devices, temperature of the diode, age, and what the chosen estimator needs.
    Exit status 1: out of date.
    """
    from picoradar.instrument.calibration import out_of_date
    from picoradar.instrument.cli.session import calibration_of
    from picoradar.instrument.settings import Settings, load_settings

    wanted = Settings() if settings is None else load_settings(settings)
    found = calibration_of(wanted)
    now = datetime.datetime.now(datetime.UTC) if wanted.bench == "devices" else None
    reasons = out_of_date(found, wanted, _serial_numbers(wanted), now)
    summary: dict[str, object] = {
        "file": wanted.calibration or "comes with the simulated bench",
        **_summary(found),
        "out_of_date": bool(reasons),
        "reasons": reasons,
    }
    if json:
        output.print_json(summary)
    else:
        title = "calibration in force: " + ("OUT OF DATE" if reasons else "up to date")
        output.print_table(title, {**summary, "reasons": "\n".join(reasons)})
    if reasons:
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)


def _serial_numbers(settings: Settings) -> Mapping[str, str]:
    """Open every device once and get its serial number."""
    from picoradar.instrument.cli.session import session

    with session(settings, None) as run:
        return {name: one.serial_number for name, one in run.identities.items()}


def _candidates(places: list[Path]) -> list[Path]:
    files: list[Path] = []
    for place in places:
        if place.is_dir():
            files += sorted({*place.glob("*calibration*.json"), *place.glob("*/calibration.json")})
        elif place.exists():
            files.append(place)
        else:
            raise BadInput(f"{place}: no such file or folder")
    return files


def _summary(one: Calibration) -> dict[str, object]:
    s = one.scanner
    return {
        "date": one.date.isoformat(),
        "digest": one.digest,
        "provenance": one.provenance,
        "serial_numbers": one.serial_numbers,
        "diode_degc": one.diode_degc,
        "range_zero_mm": one.range_zero_mm,
        "range_zero_sd_mm": one.range_zero_sd_mm,
        "materials": {name: _ranged(entries) for name, entries in one.materials.items()},
        "walk_valid_mv": {method: walk.valid_mv for method, walk in one.walk.items()},
        "templates": one.templates is not None,
        "zero_mark": _zero_mark(one),
        "zero_plate": None if one.zero_plate is None else one.zero_plate.model_dump(mode="json"),
        "mirror_separation_mm": one.mirror_separation_mm,
        **{name: getattr(s, name) for name in type(s).model_fields},
        **{f"{name}_sd": sd for name, sd in (one.geometry.sd if one.geometry else {}).items()},
    }


def _ranged(entries: Mapping[Ranging, Material]) -> dict[str, object]:
    """Return bias, its standard deviations, date and method for each way of ranging."""
    return {ranging: entry.model_dump(mode="json") for ranging, entry in entries.items()}


def _zero_mark(one: Calibration) -> dict[str, float] | None:
    return None if one.zero_mark is None else one.zero_mark.model_dump()
