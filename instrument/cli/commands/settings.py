"""``picoradar settings``: a settings file to start from, or the schema with which editors check settings files."""

from __future__ import annotations

import json as json_text
import sys
import tomllib
from typing import Annotated

import typer

from picoradar.instrument.cli import options, output
from picoradar.instrument.errors import BadInput


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(
        epilog="Examples: picoradar settings bench > my-bench.toml\n\n"
        "picoradar settings operating-room --all\n\npicoradar settings --schema > settings.schema.json"
    )(settings)


def settings(
    profile: Annotated[str | None, typer.Argument(help="bench, gray-target or operating-room.")] = None,
    every: Annotated[
        bool, typer.Option("--all", help="Every key with its meaning, not only those of the profile.")
    ] = False,
    schema: Annotated[bool, typer.Option("--schema", help="The JSON schema of settings files.")] = False,
    json: options.Json = False,
) -> None:
    """Print a settings profile as commented TOML, to be edited and used with --settings."""
    from picoradar.instrument.settings import settings_from, to_toml
    from picoradar.instrument.settings.profiles import PROFILES, profile_text

    if schema:
        sys.stdout.write(json_text.dumps(settings_schema(), indent=1) + "\n")
        return
    if profile is None:
        raise BadInput(f"settings: name a profile ({', '.join(PROFILES)}), or give --schema")
    text = profile_text(profile)
    chosen = settings_from(tomllib.loads(text), f"profile {profile}", text)
    if json:
        output.print_json({"profile": profile, "settings": chosen.model_dump(mode="json")})
    elif every:
        from picoradar.instrument.cli.simulated import checked_simulation

        sys.stdout.write(to_toml(chosen, checked_simulation(chosen)))
    else:
        sys.stdout.write(text)


def settings_schema() -> dict[str, object]:
    """Make the JSON schema of a settings file, the simulator's table included."""
    from picoradar.instrument.settings import Settings
    from picoradar.sim.settings import SimulationSettings

    schema = Settings.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "Settings of picoradar"
    simulation = SimulationSettings.model_json_schema()
    schema["$defs"] |= simulation.pop("$defs", {})
    schema["properties"]["simulation"] = simulation
    return schema
