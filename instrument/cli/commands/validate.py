"""``picoradar validate``: the simulator against the dissertation, value by value."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from picoradar.instrument.cli import options, output
from picoradar.instrument.errors import BadInput


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(epilog="Example: picoradar validate --out validation")(validate)


def validate(
    out: Annotated[Path, typer.Option("--out", help="Folder for the page and its pictures.")] = Path("validation"),
    seed: options.Seed = None,
    json: options.Json = False,
) -> None:
    """Compare the simulated radar with what the dissertation measured, on one page with pictures."""
    from picoradar.sim.validation import PARTS, SEED
    from picoradar.sim.validation import validate as compare

    with output.progress() as bar:
        task = bar.add_task("validate", total=len(PARTS), note="")
        begun = 0

        def show(part: str) -> None:
            nonlocal begun
            bar.update(task, completed=begun, note=part)
            begun += 1

        try:
            result = compare(out, SEED if seed is None else seed, show)
        except OSError as error:
            raise BadInput(f"{out}: the report cannot be written: {error}; give another folder with --out") from error
        bar.update(task, completed=len(PARTS), note="done")
    if json:
        output.print_json(result)
    else:
        output.print_table("simulator against dissertation", dict(_row(figure) for figure in result["figures"]))
        for figure in result["figures"]:
            if figure["reason"]:
                output.console().print(f"{figure['name']}: {figure['reason']}.")
        output.console().print(f"report: {result['report']}")
    if not result["passed"]:
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)


def _row(figure: Mapping[str, object]) -> tuple[str, str]:
    """Name and value of one figure, as a line of the table."""
    verdict = "FAIL" if not figure["passed"] else "DIFF" if figure["reason"] else "ok  "
    value = f"{figure['simulator']} (dissertation {figure['dissertation']}, {figure['tolerance']}; {figure['kind']})"
    return f"{verdict} {figure['name']}", value
