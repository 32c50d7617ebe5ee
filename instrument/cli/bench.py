"""``picoradar bench NAME``: the bench procedures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from instrument.cli import options, output
from instrument.errors import BadInput

if TYPE_CHECKING:
    from instrument.cli.session import Session
    from instrument.procedures.outcome import Outcome
    from instrument.procedures.station import Station


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(
        epilog="Examples: picoradar bench gray-target --out gray\n\npicoradar bench prism --settings bench.toml --json"
    )(bench)


def bench(
    name: Annotated[str, typer.Argument(help="Procedure: " + ", ".join(("gray-target", "distance", "prism")) + ".")],
    settings: options.SettingsFile = None,
    seed: options.Seed = None,
    averages: options.Averages = None,
    speed: options.Speed = "max",
    out: Annotated[Path | None, typer.Option("--out", help="Report folder to make (must not exist).")] = None,
    json: options.Json = False,
) -> None:
    """Calibrate the radar or test its accuracy; writes a report folder, and a calibration where one was made."""
    from instrument.cli import session
    from instrument.procedures import PROCEDURES
    from instrument.procedures.folder import write_outcome

    if name not in PROCEDURES:
        raise BadInput(f"bench {name!r}: no such procedure; there are {', '.join(PROCEDURES)}")
    wanted = options.scan_settings(
        settings,
        seed=seed,
        target="plate" if settings is None else None,
        target_pose=None,
        distance_mm=None,
        grid=None,
        step_mm=None,
        averages=averages,
        prf_hz=None,
        mode=None,
        estimator=None,
    )
    folder = _new_folder(out or Path(f"picoradar-{name}"))
    with session.session(wanted, options.parse_speed(speed)) as run:
        session.warm_up(run)
        outcome = _measure(run, folder, name)
    result = write_outcome(folder, outcome, settings=wanted, seed=wanted.seed if run.simulated is not None else None)
    if json:
        output.print_json(result)
    else:
        output.print_table(f"bench {name}: {'passed' if outcome.passed else 'NOT PASSED'}", _shown(outcome, folder))
    if not outcome.passed:
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)


def _measure(run: Session, folder: Path, name: str) -> Outcome:
    from instrument.procedures import PROCEDURES

    with output.progress() as bar:
        task = bar.add_task(name, total=100, note="")

        def show(share: float, note: str) -> None:
            bar.update(task, completed=100 * share, note=note)

        outcome = PROCEDURES[name](_station(run, folder, show))
        bar.update(task, completed=100, note="done")
        return outcome


def _station(run: Session, folder: Path, progress: object) -> Station:
    from instrument.cli.stages import PersonStage, SimulatedStage
    from instrument.procedures.station import Station

    stage = PersonStage() if run.simulated is None else SimulatedStage(run.simulated)
    return Station(run.controller, run.settings, run.calibration, run.identities, stage, folder, progress)  # type: ignore[arg-type]


def _new_folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True)
    except FileExistsError as error:
        raise BadInput(f"{folder} exists already; give another report folder with --out") from error
    except OSError as error:
        raise BadInput(f"{folder}: the report folder cannot be made: {error}; give another one with --out") from error
    return folder


def _shown(outcome: Outcome, folder: Path) -> dict[str, object]:
    rows: dict[str, object] = {outcome.headline[1]: outcome.headline[0]}
    rows["found"] = "\n".join(outcome.findings)
    rows["next"] = outcome.next_step
    rows["report"] = folder / "report.html"
    return rows
