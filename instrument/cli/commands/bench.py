"""``picoradar bench NAME``: the bench procedures."""

from __future__ import annotations

import datetime
import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer
from typer.core import TyperCommand

from picoradar.instrument.cli import options, output
from picoradar.instrument.cli.new_files import make_folder
from picoradar.instrument.errors import BadInput, Interrupted

if TYPE_CHECKING:
    from typer._click import Context, HelpFormatter

    from picoradar.instrument.cli.session import Session
    from picoradar.instrument.procedures.station import Outcome, Progress, Station
    from picoradar.instrument.settings import Settings


class _Bench(TyperCommand):
    """The command, whose help names the procedures; to import them takes a second, which only this help costs."""

    def format_options(self, ctx: Context, formatter: HelpFormatter) -> None:
        """Write arguments and options, and the procedures."""
        from picoradar.instrument.procedures import PROCEDURES

        super().format_options(ctx, formatter)
        with formatter.section("Procedures"):
            formatter.write_text(", ".join(PROCEDURES))


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(
        cls=_Bench,
        epilog="Examples: picoradar bench gray-target --out gray\n\n"
        "picoradar bench prism --settings bench.toml --json\n\n"
        "picoradar bench penetration --material bone --coat-mm 0.1 --out penetration\n\n"
        "picoradar bench zero --distance-mm 750 --range-sd-mm 0.1 --out zero",
    )(bench)


def bench(
    name: Annotated[str, typer.Argument(help="Procedure, one of those below.")],
    settings: options.SettingsFile = None,
    seed: options.Seed = None,
    world: options.World = None,
    averages: options.Averages = None,
    speed: options.Speed = "max",
    faults: options.Faults = None,
    hidden_errors: Annotated[
        bool,
        typer.Option("--hidden-errors", help="Simulated bench: give the scanner random errors, drawn from the seed."),
    ] = False,
    date: Annotated[
        str | None, typer.Option(help="Date that a new calibration carries, for example 2026-01-31T12:00:00Z.")
    ] = None,
    material: Annotated[
        str | None, typer.Option(help="penetration: what the half painted piece is made of (bone).")
    ] = None,
    coat_mm: Annotated[
        float | None, typer.Option(help="penetration: thickness of its paint, by micrometer, mm.", min=0.02, max=2.0)
    ] = None,
    distance_mm: Annotated[
        float | None, typer.Option(help="zero: where the plate stands, mm (800).", min=650.0, max=1200.0)
    ] = None,
    range_sd_mm: Annotated[
        float | None, typer.Option(help="zero: standard deviation of that distance, mm (0.2).", min=0.001, max=10.0)
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Report folder to make (must not exist).")] = None,
    json: options.Json = False,
) -> None:
    """Calibrate the radar or test its accuracy; write a report folder, and a calibration where one results."""
    from picoradar.instrument.cli import session
    from picoradar.instrument.cli.simulated import checked_simulation
    from picoradar.instrument.procedures.station import write_outcome

    stamp = _date(date)
    given = options.ScanOptions(seed=seed, world=world, averages=averages)
    wanted = _settings(settings, given, hidden_errors=hidden_errors)
    wanted, procedure = _chosen(name, wanted, material, coat_mm, (distance_mm, range_sd_mm))
    folder = out or Path(f"picoradar-{name}")
    make_folder(folder, "give another report folder with --out", exist_ok=False)
    try:
        with session.session(wanted, options.parse_speed(speed), faults=faults) as run:
            session.warm_up(run)
            outcome = _measure(run, procedure, _Report(folder, name, stamp))
    except Interrupted as stopped:
        raw = folder / "raw"
        kept = f"readings so far are in {raw}" if any(raw.glob("*.db")) else "no readings were kept"
        raise Interrupted(f"{stopped}; {run.controller.safe}; no report was written; {kept}") from stopped
    seed_of, simulation = (wanted.seed, checked_simulation(wanted)) if wanted.bench == "simulated" else (None, None)
    try:
        result = write_outcome(folder, outcome, settings=wanted, seed=seed_of, simulation=simulation)
    except OSError as error:
        raise BadInput(f"{folder}: the report cannot be written: {error}; make room and run this again") from error
    if json:
        output.print_json(result)
    else:
        output.print_table(f"bench {name}: {'passed' if outcome.passed else 'NOT PASSED'}", _shown(outcome, folder))
    if not outcome.passed:
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)


def _settings(file: Path | None, given: options.ScanOptions, *, hidden_errors: bool) -> Settings:
    from picoradar.instrument.cli.stages import with_hidden_errors

    whole: options.ScanOptions = {**given, "target": "plate" if file is None else None, "mode": "sweep"}
    wanted = options.scan_settings(file, **whole)
    return with_hidden_errors(wanted) if hidden_errors else wanted


def _date(text: str | None) -> datetime.datetime | None:
    if text is None:
        return None
    try:
        date = datetime.datetime.fromisoformat(text)
    except ValueError as error:
        raise BadInput(f"--date {text!r}: {error}; write it like 2026-01-31T12:00:00Z") from error
    if date.tzinfo is None:
        raise BadInput(f"--date {text!r}: needs a time zone; write it like 2026-01-31T12:00:00Z")
    return date


def _chosen(
    name: str, settings: Settings, material: str | None, coat_mm: float | None, plate: tuple[float | None, float | None]
) -> tuple[Settings, Callable[[Station], Outcome]]:
    """Return settings and procedure of a name; for a half painted piece the simulated bench puts up one as described.

    Raises
    ------
    BadInput
        When there is no such procedure or piece, an option is of another procedure, or nobody has said how thick the
        paint on a real one is.
    """
    from picoradar.instrument.procedures import PROCEDURES, zero

    if name not in PROCEDURES:
        raise BadInput(f"bench {name!r}: no such procedure; there are {', '.join(PROCEDURES)}")
    if name != "penetration" and (material is not None or coat_mm is not None):
        raise BadInput(f"bench {name}: --material and --coat-mm are for the half painted piece of penetration")
    if name != zero.NAME and plate != (None, None):
        raise BadInput(f"bench {name}: --distance-mm and --range-sd-mm are for the plate of bench zero")
    if name == "penetration":
        return _of_piece(settings, material, coat_mm)
    if name == zero.NAME:
        distance_mm, sd_mm = plate
        return settings, functools.partial(
            zero.run, distance_mm=distance_mm or zero.DISTANCE_MM, sd_mm=sd_mm or zero.SD_MM
        )
    return settings, PROCEDURES[name]


def _of_piece(
    settings: Settings, material: str | None, coat_mm: float | None
) -> tuple[Settings, Callable[[Station], Outcome]]:
    from picoradar.instrument.cli.simulated import checked_simulation
    from picoradar.instrument.procedures.penetration import procedure
    from picoradar.instrument.settings import override

    name = options.checked_material(material) or procedure.MATERIAL
    if settings.bench == "simulated":
        settings = override(settings, {"simulation": {"sample_material": name, "coat_mm": coat_mm}})
        coat_mm = float(checked_simulation(settings).model_dump()["coat_mm"])
    elif coat_mm is None:
        raise BadInput("bench penetration: give the thickness of the paint with --coat-mm, measured by micrometer")
    return settings, functools.partial(procedure.run, material=name, coat_mm=coat_mm)


class _Report(NamedTuple):
    """Where a procedure writes, its name, and the date that a new calibration carries."""

    folder: Path
    name: str
    date: datetime.datetime | None


def _measure(run: Session, procedure: Callable[[Station], Outcome], report: _Report) -> Outcome:
    def say(share: float, note: str) -> None:
        output.console().print(f"{share:4.0%} {note}", markup=False)

    if run.simulated is None:  # a bar that is redrawn would overwrite the questions to the person
        return procedure(_station(run, report, say))
    with output.progress() as bar:
        task = bar.add_task(report.name, total=100, note="")

        def show(share: float, note: str) -> None:
            bar.update(task, completed=100 * share, note=note)

        outcome = procedure(_station(run, report, show))
        bar.update(task, completed=100, note="done")
        return outcome


def _station(run: Session, report: _Report, progress: Progress) -> Station:
    from picoradar.instrument.cli.light_meters import light_meters
    from picoradar.instrument.cli.person import Person
    from picoradar.instrument.cli.stages import PersonStage, SimulatedStage
    from picoradar.instrument.procedures.station import Radar, Station

    person = Person(run.controller.rest)
    stage = PersonStage(person) if run.simulated is None else SimulatedStage(run.simulated)
    meters = light_meters(run, person) if report.name == "transmitter" else None
    seed = run.settings.seed if run.simulated is not None else None
    radar = Radar(run.controller, run.settings, run.calibration, run.identities, seed)
    return Station(radar, stage, report.folder, progress, date=report.date, meters=meters)


def _shown(outcome: Outcome, folder: Path) -> dict[str, object]:
    rows: dict[str, object] = {outcome.headline[1]: outcome.headline[0]}
    rows["found"] = "\n".join(outcome.findings)
    rows["next"] = outcome.next_step
    rows["report"] = folder / "report.html"
    return rows
