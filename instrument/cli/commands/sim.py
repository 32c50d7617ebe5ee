"""``picoradar sim``: the simulated bench for other programs, until Ctrl-C."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from picoradar.instrument.cli import options, output, signals
from picoradar.instrument.errors import BadInput

if TYPE_CHECKING:
    from picoradar.instrument.settings import Settings
    from picoradar.sim import SimulatedBench
    from picoradar.sim.server import Addresses, BenchServer

MAX_SPEED = 50.0  # above it the operating system is too slow for the host's heartbeat


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(
        epilog="Examples: picoradar sim --target prism\n\npicoradar sim --speed 20 --out bench, then elsewhere: "
        "picoradar scan --settings bench/settings.toml"
    )(sim)


def sim(
    settings: options.SettingsFile = None,
    target: options.Target = None,
    world: options.World = None,
    target_pose: options.TargetPose = None,
    distance_mm: options.DistanceMm = None,
    seed: options.Seed = None,
    speed: Annotated[str, typer.Option(help="Pace: 1 (real time) or a factor up to 50.")] = "1",
    faults: options.Faults = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for settings file and port names; default: a temporary one.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print nothing for people on stderr.")] = False,
) -> None:
    """Serve the simulated bench on ptys, socket:// ports and forwarded USB; the first line of stdout is JSON."""
    from picoradar.instrument.cli.simulated import Simulated
    from picoradar.instrument.settings import to_toml

    factor = served_speed(speed)
    wanted = options.scan_settings(
        settings, seed=seed, target=target, world=world, target_pose=target_pose, distance_mm=distance_mm
    )
    if wanted.bench != "simulated":
        raise BadInput('sim serves the simulated bench; this settings file has real devices (bench = "devices")')
    with ExitStack() as stack:
        stopped = _stop_signals()
        folder = out if out is not None else Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="picoradar-")))
        _make_folder(folder)
        simulated = Simulated(wanted, None, faults)
        stack.callback(simulated.close)
        server = stack.enter_context(_server(simulated.bench, folder.resolve(), factor))
        addresses = server.addresses()
        path = folder.resolve() / "settings.toml"
        path.write_text(to_toml(host_settings(wanted, addresses, factor, folder.resolve())), encoding="utf-8")
        output.print_json({"ready": True, **addresses, "settings": str(path), "seed": wanted.seed, "speed": factor})
        if not json:
            console = output.console()
            console.print(f"serving at speed {factor:g}; Ctrl-C ends it. In another terminal:")
            console.print(f"picoradar doctor --settings {path}", soft_wrap=True)
        server.serve(lambda: bool(stopped))


def served_speed(text: str) -> float:
    """Read the pace of a bench in another process.

    Raises
    ------
    BadInput
        When it is ``max`` or out of range.
    """
    factor = options.parse_speed(text)
    if factor is None:
        raise BadInput("--speed max: other programs run in wall time, which cannot be skipped; give 1 or a factor")
    if factor > MAX_SPEED:
        raise BadInput(
            f"--speed {factor:g}: at most {MAX_SPEED:g}; faster than that, a host could not feed the watchdog in time"
        )
    return factor


def host_settings(settings: Settings, addresses: Addresses, speed: float, folder: Path) -> Settings:
    """Make the settings with which a host reaches the served bench: sockets, forwarded USB, calibration, pace."""
    from picoradar.instrument.cli.simulated import shipped_calibration
    from picoradar.instrument.settings import Links

    calibration = folder / "calibration.json"
    calibration.write_bytes(shipped_calibration(settings).read_bytes())
    sockets = {name: ports["socket"] for name, ports in addresses["serial"].items() if name in Links.model_fields}
    usb = addresses["usb"]
    links = Links.model_validate(
        {
            **sockets,
            "temperature": settings.links.temperature,
            "usb_backend": usb["backend"],
            "usb_address": usb["address"],
            "speed": speed,
        }
    )
    return settings.model_copy(
        update={"bench": "devices", "links": links, "calibration": str(calibration), "simulation": {}}
    )


def _server(bench: SimulatedBench, folder: Path, speed: float) -> BenchServer:
    from picoradar.sim.server import BenchServer, FolderInUse

    try:
        return BenchServer(bench, folder, speed=speed)
    except FolderInUse as error:
        raise BadInput(f"{error}; end that one first, or give another folder with --out") from error
    except OSError as error:
        raise BadInput(f"{folder}: the bench cannot be served there: {error}; give another one with --out") from error


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"{folder}: the folder cannot be made: {error}; give another one with --out") from error


def _stop_signals() -> list[int]:
    """Collect the signals that end a program from now on; the list stays empty until one comes."""
    came: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        signals.leave_terminal(number)
        came.append(number)

    signals.handle(note)
    return came
