"""``picoradar cache``: where prepared models are kept, how many, how large; and to clear it."""

from __future__ import annotations

from typing import Annotated

import typer

from picoradar.instrument.cli import options, output
from picoradar.instrument.errors import BadInput


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(epilog="Examples: picoradar cache\n\npicoradar cache clear")(cache)


def cache(
    action: Annotated[str, typer.Argument(help="show or clear.")] = "show",
    clear: Annotated[bool, typer.Option("--clear", help="The same as: picoradar cache clear.")] = False,
    json: options.Json = False,
) -> None:
    """Show the cache of prepared models, or clear it; what is missing is prepared again when it is needed."""
    from picoradar.registration.model import clear_cache, contents_of_cache

    if action not in ("show", "clear"):
        raise BadInput(f"cache {action!r}: give show or clear")
    removed = None
    try:
        if clear or action == "clear":
            removed = clear_cache()
        found = contents_of_cache()
    except OSError as error:
        raise BadInput(f"{error.filename}: cannot be used ({error.strerror}); check your rights to it") from error
    result: dict[str, object] = {
        "folder": found.folder,
        "models": found.models,
        "files": found.files,
        "bytes": found.size_bytes,
        "limit_bytes": found.limit_bytes,
    }
    if removed is not None:
        result |= {"removed_models": removed.models, "removed_bytes": removed.size_bytes}
    if json:
        output.print_json(result)
    else:
        output.print_table("cache of prepared models", result)
