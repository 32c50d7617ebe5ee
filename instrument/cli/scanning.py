"""One scan from the command line: chosen, recorded with a bar, and described by the keys of the contract."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from picoradar.drivers.errors import DECODER_ERRORS, decoder_words
from picoradar.drivers.traces import CodeScale
from picoradar.instrument.acquisition import Acquisition, Setup, can_window, raster_scan
from picoradar.instrument.cli import output, zero
from picoradar.instrument.cli.session import Session
from picoradar.instrument.controller import STATE_EVENT, ScanOutcome, Subscription
from picoradar.instrument.errors import BadInput, Interrupted
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Cloud, Recording, RecordingError, cloud_of, range_error_left

if TYPE_CHECKING:
    from picoradar.instrument.cli.following import Asked, Following


class RecordedScan(NamedTuple):
    """A scan that was recorded: ``described`` by the keys of the contract, how it ended, and its points."""

    described: JsonObject
    outcome: ScanOutcome
    cloud: Cloud


def record_scan(run: Session, path: Path, asked: Asked | None = None) -> RecordedScan:
    """Take one scan into a new recording; with something asked, register it meanwhile and end it when that is reached.

    Raises
    ------
    Interrupted
        After the safe shutdown, when Ctrl-C or SIGTERM came; the lines so far are kept.
    """
    sampler = run.controller.bench.sampler
    job = job_for(run)
    _warn_of_unmeasured(run, job)
    header = job.header(
        run.identities,
        seed=run.settings.seed if run.simulated is not None else None,
        scale=CodeScale(sampler.zero_code, sampler.mv_per_code),
    )
    if run.simulated is not None and run.simulated.faults:
        header["faults"] = run.simulated.faults
    if checked := zero.plate_now(run.settings, run.calibration):
        header[zero.PLATE] = checked
    return _scan_into(run, job, Recording.create(path, header), asked)


def _warn_of_unmeasured(run: Session, job: Acquisition) -> None:
    """Say before the scan that nothing will be taken off for a material that was named but never measured."""
    material = run.settings.scan.material
    if material and run.calibration.range_error(material, job.capture.ranging).sd_mm is None:
        output.console().print(
            f"range error on {material} not taken off: the calibration has none for {job.capture.ranging}; "
            f"measure it with: picoradar bench penetration --material {material}",
            markup=False,
            soft_wrap=True,
        )


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
    if checked := zero.plate_now(run.settings, run.calibration):
        recording.event(run.controller.bench.clock.now(), zero.PLATE, age_h=checked["age_h"])
    job = job_for(run, recording.missing)
    _remember(job, recording)
    return _scan_into(run, job, recording)


def _remember(job: Acquisition, recording: Recording) -> None:
    """Hand over what was known after each line, and try now, before there is light, that it can be used."""
    states = {event.fields.get("line"): event.fields for event in recording.events() if event.kind == STATE_EVENT}
    try:
        known = {line: states[line] for line in recording.done if line in states}
        job.resume_from(known, recording.lines(traces=False))
        for row in recording.missing:
            job.recall(row)
    except DECODER_ERRORS as error:
        recording.close()
        what = f"what a line knew of those before is damaged ({decoder_words(error)})"
        raise RecordingError(recording.path, what, "make a new scan") from error


def job_for(run: Session, rows: Sequence[int] | None = None) -> Acquisition:
    """Choose how to scan: in windows where the settings ask for it and the devices can, else in whole sweeps."""
    bench = run.controller.bench
    in_windows = run.settings.scan.mode == "window" and can_window(bench.galvo, bench.sampler)
    setup = Setup(run.settings, run.calibration, bench.clock)
    return raster_scan(setup, rows, in_windows=in_windows, mark=zero.mark_for(setup))


def _scan_into(run: Session, job: Acquisition, recording: Recording, asked: Asked | None = None) -> RecordedScan:
    began, following = time.perf_counter(), None
    if asked is not None:
        from picoradar.instrument.cli.following import Following  # the registration takes its time to be imported

        following = Following(asked, run, job, recording)
    with recording:
        lines = list(recording.lines(traces=False))  # of an earlier part of the scan; empty for a new one
        try:
            sinks = [Subscription(lambda line: lines.append(line.without_raw_samples()), "result", every_line=True)]
            if following is not None:
                sinks.append(Subscription(following.take, "registration", every_line=True))
            outcome = _scan_with_bar(run, job, recording, sinks, following)
        except Exception as error:
            error.add_note(_what_next(len(lines), recording))
            raise
    cloud = cloud_of(lines, raster=True, stretch=recording.header.get("stretch"))
    result = {"recording": str(recording.path), "lines": len(lines), **describe_scan(run, job, cloud, outcome)}
    result["zero_check"] = zero.check_of(recording.path).to_dict()
    result["wall_s"] = round(time.perf_counter() - began, 3)
    if outcome.stop_reason == "interrupted":
        safe = "laser off verified" if outcome.safe.laser_off_verified else str(outcome.safe)
        raise Interrupted(f"interrupted; {safe}; {_what_next(len(lines), recording)}")
    if following is not None:
        result["registration"] = following.finish(cloud)
    return RecordedScan(result, outcome, cloud)


def _what_next(lines: int, recording: Recording) -> str:
    """Say what is kept of a scan that was broken off, and how to go on with it."""
    return f"{lines} lines kept in {recording.path}; go on with: picoradar resume {recording.path}"


def _scan_with_bar(
    run: Session, job: Acquisition, recording: Recording, sinks: Sequence[Subscription], following: Following | None
) -> ScanOutcome:
    with output.progress() as bar:
        task = bar.add_task("scan", total=len(job.rows), note="")

        def show(line: ScanLine) -> None:
            found = int(line.has_range.sum())
            device_s = run.controller.bench.clock.now()
            pose = "" if following is None else f"; {following.note()}"
            bar.update(task, advance=1, note=f"{found}/{len(line.flags)} points, device time {device_s:.0f} s{pose}")

        return run.controller.scan(job, recording, [*sinks, Subscription(show, "progress")])


def describe_scan(run: Session, job: Acquisition, cloud: Cloud, outcome: ScanOutcome) -> JsonObject:
    """Describe a scan by the keys of the command's contract (without ``recording``, ``lines`` and ``wall_s``)."""
    scan = run.settings.scan
    result: JsonObject = {
        "points": int(cloud.has_range.sum()),
        "lines_taken": outcome.lines,
        "grid": [scan.rows, scan.columns],
        "step_mm": scan.step_mm,
        "mode": job.mode,
        "averages": scan.averages,
        "range_error": range_error_left(
            run.calibration.range_error(scan.material, job.capture.ranging)._asdict(),
            cloud,
            run.calibration.stretch_terms(scan.material, job.capture.ranging),
        ),
        "device_time_s": round(outcome.device_time_s, 6),
        "shot_limited_s": job.shots / run.settings.pulser.prf_hz,
        "flags": cloud.flag_counts,
        "two_echoes": int(cloud.with_range().two_echoes.sum()),
        "laser_off_verified": outcome.safe.laser_off_verified,
        "safe_state": outcome.safe.steps,
        "suspended": outcome.suspended,
        "stop_reason": outcome.stop_reason,
    }
    if run.simulated is not None:
        result["truth"] = run.simulated.truth_of(cloud)
    return result
