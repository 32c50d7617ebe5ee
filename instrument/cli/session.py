"""One run of the radar from the command line: bench opened, diode warm, scan recorded, everything off again."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import numpy as np

from picoradar.drivers.clock import ScaledClock
from picoradar.drivers.interfaces import Identity, TemperatureStatus
from picoradar.drivers.links import Transcript
from picoradar.drivers.traces import CodeScale
from picoradar.instrument.acquisition import (
    Acquisition,
    RasterPlan,
    Setup,
    can_window,
    raster_scan,
    refuse_enormous_lines,
)
from picoradar.instrument.bench import make_bench
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.cli import output
from picoradar.instrument.cli.simulated import Simulated
from picoradar.instrument.controller import STATE_EVENT, Controller, ScanOutcome, Sink
from picoradar.instrument.errors import BadInput, Interrupted
from picoradar.instrument.line import Flag, ScanLine
from picoradar.instrument.recording import Cloud, Recording, cloud_of
from picoradar.instrument.settings import Settings


@dataclass
class Session:
    """An open bench with its controller.

    Attributes
    ----------
    settings : Settings
    controller : Controller
        Connected; the diode is cold.
    identities : dict
        Who answered.
    calibration : Calibration
        In force for this session.
    simulated : Simulated or None
        The simulated bench behind the links, if it is one.
    """

    settings: Settings
    controller: Controller
    identities: dict[str, Identity]
    calibration: Calibration
    simulated: Simulated | None


@contextmanager
def session(
    settings: Settings,
    speed: float | None,
    transcript: Transcript | None = None,
    *,
    faults: Path | None = None,
    calibration: Calibration | None = None,
) -> Iterator[Session]:
    """Open the bench of the settings; leave it safe and closed, however it ends.

    While the session is open, Ctrl-C and SIGTERM ask the controller to end safely; a second one is an emergency off.
    """
    calibration = calibration_of(settings) if calibration is None else calibration
    refuse_enormous_lines(settings.scan.columns, settings.sampler.samples)  # before anything is switched
    RasterPlan.of(settings, calibration)  # refuses what does not fit into the scanner's span
    if faults is not None and settings.bench != "simulated":
        raise BadInput("--faults declares faults of the simulated bench; this settings file has real devices")
    simulated = Simulated(settings, speed, faults) if settings.bench == "simulated" else None
    try:
        if simulated is None:
            bench = make_bench(settings.links, ScaledClock(settings.links.speed), transcript=transcript)
        else:
            bench = make_bench(simulated.links, simulated.clock, simulated.usb_backend, transcript)
        controller = Controller(bench, settings)
        with _signals_to(controller):
            try:
                yield Session(settings, controller, controller.connect(), calibration, simulated)
            finally:
                if controller.state in ("connected", "ready"):
                    controller.shut_down()
                elif controller.state == "fault":
                    controller.acknowledge()
    finally:
        if simulated is not None:
            simulated.close()


def calibration_of(settings: Settings) -> Calibration:
    """Load the calibration that the settings name, or the one that was measured on the simulated bench.

    Raises
    ------
    BadInput
        When real devices are to be used without one, or the file cannot be used.
    """
    if settings.calibration:
        return Calibration.load(Path(settings.calibration))
    if settings.bench != "simulated":
        raise BadInput("settings: calibration is empty; real devices need the calibration file of this radar")
    with resources.as_file(resources.files("picoradar.instrument") / "data" / "simulated-bench.json") as path:
        return Calibration.load(path)


@contextmanager
def _signals_to(controller: Controller) -> Iterator[None]:
    asked = 0

    def handle(_signal: int, _frame: FrameType | None) -> None:
        nonlocal asked
        asked += 1
        controller.request("interrupt" if asked == 1 else "emergency off")

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            # Once a person has asked to stop, the safe shutdown runs to its end: more signals change nothing.
            signal.signal(number, signal.SIG_IGN if asked else handler)


def warm_up(run: Session) -> None:
    """Warm the diode up, with a bar from where it starts to its target."""
    target = run.settings.diode.target_degc
    with output.progress() as bar:
        task = bar.add_task("warm-up", total=100, note="")
        first: list[float] = []

        def show(status: TemperatureStatus) -> None:
            first[:1] = first[:1] or [status.temperature_degc]
            way = abs(target - first[0]) or 1.0
            done = 99 * (1 - min(1.0, abs(target - status.temperature_degc) / way))
            bar.update(task, completed=100 if status.stable else done, note=f"{status.temperature_degc:.2f} degC")

        run.controller.warm_up(show)


class RecordedScan(NamedTuple):
    """A scan that was recorded: ``described`` by the keys of the contract, how it ended, and its points."""

    described: dict[str, Any]
    outcome: ScanOutcome
    cloud: Cloud


def record_scan(run: Session, path: Path) -> RecordedScan:
    """Take one scan into a new recording.

    Raises
    ------
    Interrupted
        After the safe shutdown, when Ctrl-C or SIGTERM came; the lines so far are kept.
    """
    sampler = run.controller.bench.sampler
    job = job_for(run)
    header = job.header(
        run.identities,
        seed=run.settings.seed if run.simulated is not None else None,
        scale=CodeScale(sampler.zero_code, sampler.mv_per_code),
    )
    if run.simulated is not None and run.simulated.faults:
        header["faults"] = run.simulated.faults
    return _scan_into(run, job, Recording.create(path, header))


def resume_scan(run: Session, path: Path) -> RecordedScan:
    """Take the lines that a recording lacks; what is returned is of the whole scan.

    Raises
    ------
    Interrupted
        As `record_scan`.
    BadInput
        When it is no scan of a raster.
    RecordingError
        When nothing is missing, or another program writes to it.
    """
    with Recording.open(path) as broken_off:
        kind = broken_off.raster.get("plan", "raster")  # those of earlier versions do not say it
    if kind != "raster":
        raise BadInput(f"{path}: holds {kind} of a bench procedure, which cannot be resumed; run the procedure again")
    recording = Recording.resume(path)
    job = job_for(run, recording.missing)
    done = recording.done
    for event in recording.events():
        if event.kind == STATE_EVENT and done and event.fields["line"] == done[-1]:
            job.load_state(event.fields)
    return _scan_into(run, job, recording)


def job_for(run: Session, rows: Sequence[int] | None = None) -> Acquisition:
    """Choose how to scan: in windows where the settings ask for it and the devices can, else in whole sweeps."""
    bench = run.controller.bench
    in_windows = run.settings.scan.mode == "window" and can_window(bench.galvo, bench.sampler)
    return raster_scan(Setup(run.settings, run.calibration, bench.clock), rows, in_windows=in_windows)


def _scan_into(run: Session, job: Acquisition, recording: Recording) -> RecordedScan:
    began = time.perf_counter()
    with recording:
        lines = list(recording.lines(traces=False))  # of an earlier part of the scan; empty for a new one
        outcome = _scan_with_bar(run, job, recording, lambda line: lines.append(line.without_raw_samples()))
    cloud = cloud_of(lines)
    result = {"recording": str(recording.path), "lines": len(lines), **describe_scan(run, job, cloud, outcome)}
    result["wall_s"] = round(time.perf_counter() - began, 3)
    if outcome.stop_reason == "interrupted":
        safe = "laser off verified" if outcome.safe.laser_off_verified else str(outcome.safe)
        raise Interrupted(f"interrupted; {safe}; {result['lines']} lines kept in {recording.path}")
    return RecordedScan(result, outcome, cloud)


def _scan_with_bar(run: Session, job: Acquisition, recording: Recording, keep: Sink) -> ScanOutcome:
    with output.progress() as bar:
        task = bar.add_task("scan", total=len(job.rows), note="")

        def show(line: ScanLine) -> None:
            found = int(line.has_range.sum())
            device_s = run.controller.bench.clock.now()
            bar.update(task, advance=1, note=f"{found}/{len(line.flags)} points, device time {device_s:.0f} s")

        return run.controller.scan(job, recording, [keep, show])


def describe_scan(run: Session, job: Acquisition, cloud: Cloud, outcome: ScanOutcome) -> dict[str, Any]:
    """Describe a scan by the keys of the command's contract (without ``recording``, ``lines`` and ``wall_s``)."""
    scan = run.settings.scan
    result: dict[str, Any] = {
        "points": int(cloud.has_range.sum()),
        "lines_taken": outcome.lines,
        "grid": [scan.rows, scan.columns],
        "step_mm": scan.step_mm,
        "mode": job.mode,
        "averages": scan.averages,
        "device_time_s": round(outcome.device_time_s, 6),
        "shot_limited_s": job.shots / run.settings.pulser.prf_hz,
        "flags": {f.words: n for f in Flag if f and (n := int(np.count_nonzero(cloud.flags & np.uint16(f))))},
        "laser_off_verified": outcome.safe.laser_off_verified,
        "safe_state": outcome.safe.steps,
        "suspended": outcome.suspended,
        "stop_reason": outcome.stop_reason,
    }
    if run.simulated is not None:
        result["truth"] = run.simulated.truth_of(cloud)
    return result
