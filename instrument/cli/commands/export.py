"""``picoradar export``: a recording as a file that other programs read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from picoradar.instrument.cli import output
from picoradar.instrument.cli.options import Json


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(
        epilog="Examples: picoradar export scan.db -o cloud.ply\n\npicoradar export scan.db -o traces.h5 --waveforms"
    )(export)


def export(
    recording: Annotated[Path, typer.Argument(help="Recording of a scan.")],
    out: Annotated[
        Path, typer.Option("-o", help="File to write; its ending is the form: .ply .csv .npz .las .h5 .zarr")
    ],
    waveforms: Annotated[bool, typer.Option("--waveforms", help="Write the raw traces too.")] = False,
    json: Json = False,
) -> None:
    """Write the points of a recording (points without a range are left out)."""
    from picoradar.instrument.cli import zero
    from picoradar.instrument.files.export import export as write
    from picoradar.instrument.recording import Recording

    check = zero.check_of(recording).to_dict()
    with Recording.open(recording) as scan:
        result = write(scan, out, waveforms=waveforms, zero_check=check)
    if json:
        output.print_json(result)
    else:
        output.print_table("exported", result)
