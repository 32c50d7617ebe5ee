"""``picoradar demo``: the main job from one command, on the simulated bench and a real hip bone."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picoradar.instrument.cli import options, output
from picoradar.instrument.cli.commands import register as registering
from picoradar.instrument.cli.new_files import make_folder, refuse_taken
from picoradar.instrument.cli.register_options import ToleranceOption
from picoradar.instrument.errors import BadInput
from picoradar.instrument.events import JsonObject

if TYPE_CHECKING:
    from picoradar.instrument.cli.demo_steps import DemoRegistration
    from picoradar.instrument.settings import Settings

MIN_POINTS = 6
MATERIAL = "bone"  # of the hip


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(epilog="Examples: picoradar demo\n\npicoradar demo --seed 7 --out my-report --json")(demo)


def demo(
    seed: options.Seed = None,
    settings: options.SettingsFile = None,
    target: options.Target = None,
    world: options.World = None,
    target_pose: options.TargetPose = None,
    distance_mm: options.DistanceMm = None,
    grid: options.Grid = None,
    step_mm: options.StepMm = None,
    averages: options.Averages = None,
    prf_hz: options.PrfHz = None,
    mode: options.Mode = None,
    estimator: options.Estimator = None,
    material: options.Material = None,
    method: Annotated[str, typer.Option(help="Registration: robust or dissertation.")] = "robust",
    tolerance: ToleranceOption = None,
    speed: options.Speed = "max",
    out: Annotated[
        Path | None, typer.Option("--out", help="Report folder to make; must not hold a recording yet.")
    ] = None,
    json: options.Json = False,
) -> None:
    """Warm up, scan a real hip socket on the simulated bench, register it, and write a report folder."""
    from picoradar.instrument.cli import scanning, session, zero
    from picoradar.instrument.cli.demo_steps import DemoAsked, register_scan, write_folder

    began = time.perf_counter()
    wanted = options.scan_settings(
        settings,
        seed=seed,
        target=target,
        world=world,
        target_pose=target_pose,
        distance_mm=distance_mm,
        grid=grid,
        step_mm=step_mm,
        averages=averages,
        prf_hz=prf_hz,
        mode=mode,
        estimator=estimator,
        material=material,
    )
    wanted, folder = _of_demo(wanted), report_folder(out)
    chosen, allowed = registering.checked_method(method), registering.parse_tolerance(tolerance)
    with session.session(wanted, options.parse_speed(speed)) as run:
        if run.simulated is None:
            raise BadInput("demo runs on the simulated bench")
        session.warm_up(run)
        scanned, _, cloud = scanning.record_scan(run, folder / "scan.db")
        against = zero.objections(zero.check_of(folder / "scan.db"))
        asked = DemoAsked(chosen, allowed, scanned["range_error"]["sd_mm"], against)
        found = register_scan(run.simulated, cloud, asked)
    result = {**_result(folder, scanned, found), "wall_s": round(time.perf_counter() - began, 3)}
    with output.console().status("writing the report"):
        write_folder(folder, wanted, cloud, found, {**result, "passed": accepted(result, found)})
    result["wall_s"] = round(time.perf_counter() - began, 3)
    (output.print_json if json else _show)(result)
    if not accepted(result, found):
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)


def _result(folder: Path, scanned: JsonObject, found: DemoRegistration) -> JsonObject:
    parts = {"scan": scanned, "registration": found.described, "truth_error": found.registered.truth_error}
    return {**parts, "report": str(folder / "report.html")}


def _of_demo(settings: Settings) -> Settings:
    """Return the settings with the material of the hip, where they name none; refuse those that are not of a demo.

    Raises
    ------
    BadInput
    """
    from picoradar.instrument.settings import override

    if settings.bench != "simulated":
        raise BadInput("demo runs on the simulated bench; for real devices use: picoradar scan --settings FILE")
    if settings.simulation.get("target") not in (None, "hip"):
        raise BadInput("demo needs the landmarks of the hip; for another target use: picoradar scan --target ...")
    if settings.scan.rows * settings.scan.columns < MIN_POINTS:
        raise BadInput(f"a pose needs at least {MIN_POINTS} points; give a larger --grid")
    return override(settings, {"scan": {"material": settings.scan.material or MATERIAL}})


def accepted(result: JsonObject, found: DemoRegistration) -> bool:
    """Get whether the demo did what it promises: laser off, verdict not ``fail``, true error within what it states."""
    verdict = found.registered.registration.verdict
    return bool(result["scan"]["laser_off_verified"]) and verdict != "fail" and not found.registered.known_wrong


def report_folder(out: Path | None) -> Path:
    """Make the report folder.

    Raises
    ------
    BadInput
        When it cannot be made or holds a recording already, which is never written over.
    """
    folder = out if out is not None else _free_name()
    make_folder(folder, "give another one with --out")
    refuse_taken(folder / "scan.db", "give another folder with --out")
    return folder


def _free_name() -> Path:
    folder, number = Path("picoradar-demo"), 2
    while folder.exists():
        folder, number = Path(f"picoradar-demo-{number}"), number + 1
    return folder


def _show(result: JsonObject) -> None:
    scan, registration, error = result["scan"], result["registration"], result["truth_error"]
    output.print_table(
        "demo",
        {
            "points": f"{scan['points']} of {scan['grid'][0] * scan['grid'][1]}",
            "device time": f"{scan['device_time_s']:.1f} s (shots alone {scan['shot_limited_s']:.1f} s)",
            "range error, rms": f"{scan['truth']['range_rms_mm']:.3f} mm",
            "target": "{material}, {bias_mm:.2f} mm taken off each range".format(**scan["range_error"]),
            "range zero": scan["zero_check"]["sentence"],
            "laser off": "verified" if scan["laser_off_verified"] else "NOT VERIFIED",
            "verdict": registration["verdict"] + ": " + " ".join(registration["reasons"]),
            "true error of the pose": f"{error['rotation_deg']:.3f} deg, {error['translation_mm']:.3f} mm",
            "largest error in the socket": f"{error['tre_mm']:.3f} mm",
            "largest error at a target": f"{error['at_targets_mm']:.3f} mm{_stated(registration['targets'])}",
            "took": f"{result['wall_s']:.1f} s",
            "report": result["report"],
        },
    )


def _stated(targets: list[JsonObject]) -> str:
    known = [target["stated_mm"] for target in targets if target["stated_mm"] is not None]
    return f", stated {max(known):.3f} mm" if known else ""
