"""The option ``--transcript``: every byte that crosses the links, in a side file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picoradar.instrument.cli import output
from picoradar.instrument.errors import BadInput

if TYPE_CHECKING:
    from picoradar.drivers.links import Transcript

TranscriptFile = Annotated[
    Path | None,
    typer.Option("--transcript", help="File to make: every byte to and from the devices."),
]


@contextmanager
def transcript_to(path: Path | None) -> Iterator[Transcript | None]:
    """Open the transcript, if one is wanted.

    Raises
    ------
    BadInput
        When the file exists already or cannot be made.
    """
    if path is None:
        yield None
        return
    from picoradar.drivers.links import Transcript

    try:
        transcript = Transcript(path)
    except FileExistsError as error:
        raise BadInput(f"{path} exists already and will not be written over; give --transcript another name") from error
    except OSError as error:
        raise BadInput(f"{path}: the transcript cannot be made: {error}; give --transcript another name") from error
    try:
        with transcript:
            yield transcript
    finally:
        if transcript.failure:
            output.console().print(
                f"{path}: the transcript ends early: {transcript.failure}; the work itself does not", markup=False
            )
