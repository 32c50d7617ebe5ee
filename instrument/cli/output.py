"""Output of the subcommands: tables for people or one JSON object on stdout; everything else on stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

EXIT_DONE = 0
EXIT_NOT_ACCEPTED = 1
EXIT_BAD_INPUT = 2
EXIT_DEVICE = 3
EXIT_INTERLOCK = 4
EXIT_INTERRUPTED = 130


def print_json(result: Mapping[str, object]) -> None:
    """Print one JSON object, and nothing else, on stdout; NaN and infinities become null."""
    from picoradar.instrument.recording import plain

    sys.stdout.write(json.dumps(plain(result), allow_nan=False) + "\n")
    sys.stdout.flush()


def console() -> Console:
    """Get the console for people; it writes to stderr, so that stdout stays for results."""
    from rich.console import Console

    return Console(stderr=True, highlight=False)


def print_table(title: str, rows: Mapping[str, object]) -> None:
    """Print a small two-column table on stdout."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, show_header=False, title_justify="left", title_style="bold")
    for name, value in rows.items():
        table.add_row(name, str(value))
    Console(highlight=False).print(table)


def progress() -> Progress:
    """Get a progress display on stderr; it stays silent where stderr is no terminal."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    screen = console()
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[note]}"),
        console=screen,
        disable=not screen.is_terminal,
    )
