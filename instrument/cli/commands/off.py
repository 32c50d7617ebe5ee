"""``picoradar off``: brings every device to its safe state, whatever it was left doing; for a button or a service."""

from __future__ import annotations

import typer

from picoradar.instrument.cli import options, output, signals

BARRIERS = ("gate", "pulser")


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(epilog="Examples: picoradar off --settings bench.toml\n\npicoradar off --settings bench.toml --json")(
        off
    )


def off(settings: options.SettingsFile = None, json: options.Json = False) -> None:
    """Bring every device to its safe state, verify it, say what was on; exit 0 when all barriers are closed, else 4.

    For a bench that a program has left behind (killed, its computer gone): the watchdog has closed the gate then, but
    triggers and drive voltage stay on. Needs no calibration, and tries every device, also when others are missing.
    """
    from picoradar.drivers.clock import ScaledClock
    from picoradar.instrument.bench import make_bench, reachable_bench
    from picoradar.instrument.cli.simulated import Simulated
    from picoradar.instrument.controller import switch_off
    from picoradar.instrument.settings import Settings, load_settings

    wanted = Settings() if settings is None else load_settings(settings)
    signals.ignore_from_now_on()  # it ends by itself in seconds, and there is nothing better to do
    simulated = Simulated(wanted, None) if wanted.bench == "simulated" else None
    if simulated is None:
        bench = reachable_bench(wanted.links, ScaledClock(wanted.links.speed))
    else:
        bench = make_bench(simulated.links, simulated.clock, simulated.usb_backend)
    found_on, safe = switch_off(bench)
    if simulated is not None:
        simulated.close()
    closed = all(safe.steps[name] == "verified" for name in BARRIERS)
    result = {"laser_off_verified": safe.laser_off_verified, "found_on": list(found_on), "steps": safe.steps}
    if json:
        output.print_json(result)
    else:
        output.print_table("off", {"found on": ", ".join(found_on) or "nothing", "result": str(safe), **safe.steps})
    if not closed:
        raise typer.Exit(output.EXIT_INTERLOCK)
