"""``picoradar reprocess`` (also ``rerange``): ranges from the raw traces of a recording, computed again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picoradar.instrument.cli import options, output
from picoradar.instrument.errors import BadInput

if TYPE_CHECKING:
    from picoradar.instrument.settings import Method


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    epilog = (
        "Examples: picoradar reprocess scan.db -o better.db --estimator template\n\n"
        "picoradar reprocess scan.db -o bone.db --calibration penetration/calibration.json --material bone"
    )
    app.command(epilog=epilog)(reprocess)
    app.command("rerange", epilog=epilog, hidden=True)(reprocess)  # the earlier name


def reprocess(
    recording: Annotated[Path, typer.Argument(help="Recording with its raw traces or windows.")],
    out: Annotated[Path, typer.Option("-o", help="Recording to make (a file that does not exist).")],
    estimator: options.Estimator = None,
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration file; by default the one that the recording holds.")
    ] = None,
    material: options.Material = None,
    json: options.Json = False,
) -> None:
    """Compute the ranges of a recording again, with another estimator or calibration; the old one is kept."""
    from picoradar.instrument import acquisition
    from picoradar.instrument.calibration import Calibration
    from picoradar.instrument.cli.commands.info import describe_recording, zero_words
    from picoradar.instrument.line import ScanLine
    from picoradar.instrument.recording import Recording

    method = checked_method(estimator)
    target = options.checked_material(material)
    with output.progress() as bar:
        task = bar.add_task("ranging", total=None, note="")

        def show(line: ScanLine) -> None:
            bar.update(task, advance=1, note=f"line {line.index}")

        used = Calibration.load(calibration) if calibration is not None else None
        acquisition.reprocess(recording, out, method=method, calibration=used, material=target, on_line=show)
    with Recording.open(out) as made:
        result = describe_recording(made)
    if json:
        output.print_json(result)
    else:
        shown = ("lines", "lines_ok", "complete", "stop_reason", "raster")
        output.print_table(str(out), {**{key: result[key] for key in shown}, "range zero": zero_words(result)})


def checked_method(name: str | None) -> Method | None:
    """Check the name of an estimator; None is the recording's own.

    Raises
    ------
    BadInput
    """
    from picoradar.instrument.settings import METHODS

    if name is None:
        return None
    for method in METHODS:
        if name == method:
            return method
    raise BadInput(f"--estimator {name!r}: give {' or '.join(METHODS)}")
