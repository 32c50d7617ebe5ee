"""Entry point of the command: the subcommands, and how every failure becomes one line and an exit status."""

from __future__ import annotations

import logging
import sys
from typing import Annotated

import typer

from picoradar.instrument.cli import output, signals, streams

# Some versions of Typer carry their own copy of click, others use the package: its errors are found through Typer.
UsageError: type[Exception] = typer.BadParameter.__bases__[0]

app = typer.Typer(
    name="picoradar",
    help="Run a picosecond pulsed laser radar (real or simulated) and register its point clouds to a bone model.\n\n"
    "Start with: picoradar demo",
    invoke_without_command=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def common(
    context: typer.Context,
    verbose: Annotated[bool, typer.Option("--verbose", help="Log every event to stderr.")] = False,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Options before the subcommand; without one, help."""
    if version:
        from importlib import metadata

        typer.echo(f"picoradar {metadata.version('picoradar')}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
        return
    from picoradar.instrument import events

    keep = events.IncidentLog(events.log_file())
    events.configure(logging.INFO if verbose else logging.WARNING, keep=keep)


def main(arguments: list[str] | None = None) -> None:
    """Run the command and end the process with the exit status of the contract."""
    arguments = sys.argv[1:] if arguments is None else arguments
    streams.make_tolerant()
    signals.interrupt_from_now_on()
    code = run(arguments)
    signals.ignore_from_now_on()  # the result is printed: a second Ctrl-C must not change the exit status
    streams.tell_of_failures()
    sys.exit(code)


def run(arguments: list[str]) -> int:
    """Run the command and return its exit status; failures become one line on stderr (and JSON where asked)."""
    try:
        code = app(args=arguments, standalone_mode=False, prog_name="picoradar")
        if code == output.EXIT_INTERRUPTED:  # typer turns a Ctrl-C of its own into this
            return _failed(arguments, output.EXIT_INTERRUPTED, "interrupted while no device was open and the laser off")
        return code if isinstance(code, int) else output.EXIT_DONE
    except typer.Exit as end:
        return end.exit_code
    except UsageError as error:
        return _failed(arguments, output.EXIT_BAD_INPUT, _usage(error))
    except (KeyboardInterrupt, typer.Abort):
        return _failed(arguments, output.EXIT_INTERRUPTED, "interrupted")
    except Exception as error:
        code = exit_status(error)
        if code is None:
            raise
        return _failed(arguments, code, "; ".join([str(error), *getattr(error, "__notes__", [])]))


def exit_status(error: Exception) -> int | None:
    """Get the exit status of the contract for a known failure; None for a defect of the program."""
    from picoradar.drivers.errors import DeviceError, LimitError
    from picoradar.instrument.errors import PicoradarError
    from picoradar.instrument.recording import RecordingError
    from picoradar.registration.errors import RegistrationError

    if isinstance(error, PicoradarError):
        return error.exit_status
    if isinstance(error, (LimitError, RegistrationError, RecordingError)):
        return output.EXIT_BAD_INPUT
    if isinstance(error, DeviceError):
        return output.EXIT_DEVICE
    return None


def _usage(error: Exception) -> str:
    context = getattr(error, "ctx", None)
    hint = f"; see: {context.command_path} --help" if context is not None else ""
    return str(getattr(error, "format_message", error.__str__)()).rstrip(".") + hint


def _failed(arguments: list[str], code: int, message: str) -> int:
    line = " ".join(message.split())
    if code in (output.EXIT_DEVICE, output.EXIT_INTERLOCK):
        from picoradar.instrument import events

        events.note_incident("command ended", exit_status=code, error=line)
    sys.stderr.write(f"picoradar: {line}\n")
    if "--json" in arguments:
        output.print_json({"error": line, "exit_status": code})
    return code


def _register_subcommands() -> None:
    from picoradar.instrument.cli.commands import (
        bench,
        cache,
        calibration,
        demo,
        doctor,
        export,
        info,
        laser_class,
        off,
        register,
        reprocess,
        resume,
        scan,
        settings,
        sim,
        validate,
    )

    modules = (demo, settings, doctor, off, sim, scan, resume, info, export, reprocess, register)
    for module in (*modules, bench, calibration, validate, laser_class, cache):
        module.add_to(app)


_register_subcommands()
