"""A scan that is registered while it is made: the sink that follows its lines, and what is left of it at the end."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from picoradar.instrument.acquisition import Acquisition
from picoradar.instrument.cli import zero
from picoradar.instrument.cli.commands.register import describe
from picoradar.instrument.cli.session import Session
from picoradar.instrument.errors import BadInput
from picoradar.instrument.events import JsonObject
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Cloud, Recording, digest, range_error_left
from picoradar.registration import Model, Objection, RegistrationError, Tolerance, load_model, register
from picoradar.registration.live import LiveRegistration, LiveResult, RegisterOptions, tre_mm

LASER_ON = "laser on"
"""Kind of the event that the times of a live registration are counted from."""


@dataclass(frozen=True)
class Asked:
    """What a scan is registered to, and when that is enough.

    Attributes
    ----------
    model : Model
    options : RegisterOptions
        Start, targets, regions, tolerance.
    until_tre_mm : float or None
        Predicted error at every target, root mean square with a common range error, at which the scan ends; None: at
        verdict ``pass``.
    prepare_ms : float
        What preparing the model took.
    """

    model: Model
    options: RegisterOptions
    until_tre_mm: float | None = None
    prepare_ms: float = 0.0


def asked(model: Path, options: RegisterOptions, until_tre_mm: float | None) -> Asked:
    """Prepare a model, before there is light.

    Raises
    ------
    MeshError
        When it cannot be used.
    BadInput
        When the error asked for is none.
    """
    if until_tre_mm is not None and not 0.0 < until_tre_mm < float("inf"):
        raise BadInput(f"--until-tre {until_tre_mm}: give an error in mm above 0, for example 0.3")
    began = time.perf_counter()
    prepared = load_model(model)
    return Asked(prepared, options, until_tre_mm, (time.perf_counter() - began) * 1e3)


class Following:
    """Follows one scan; `take` is its sink, which ends the scan when enough is known.

    Parameters
    ----------
    asked : Asked
    run : Session
    job : Acquisition
    recording : Recording
        That the lines go to; with what it tells of its range zero and of the common range error.
    """

    def __init__(self, asked: Asked, run: Session, job: Acquisition, recording: Recording) -> None:
        self._asked, self._run, self._job, self._recording = asked, run, job, recording
        self._live: LiveRegistration | None = None
        self._pose_s: float | None = None
        self._reached_s: float | None = None

    @property
    def result(self) -> LiveResult:
        """Get what the lines so far say."""
        return LiveResult() if self._live is None else self._live.result

    def take(self, line: ScanLine) -> None:
        """Take a line in, and ask for the end of the scan when the verdict is reached."""
        if self._live is None:  # now it is known whether the range zero was checked
            self._live = LiveRegistration(self._asked.model, **self._options(zero.objections_so_far(self._recording)))
        found = self._live.add(line)
        if self._pose_s is None and found is not None:
            self._pose_s = self._run.controller.bench.clock.now()
        if self._reached_s is None and self._live.reaches(self._asked.until_tre_mm):
            self._reached_s = self._run.controller.bench.clock.now()
            self._run.controller.request("registered")

    def note(self) -> str:
        """Say in a few words what is known of the pose."""
        return in_words(self.result)

    def finish(self, cloud: Cloud) -> JsonObject:
        """Register the whole cloud as `picoradar register` does, write that into the recording, and describe it.

        Called when the scan is over and its recording closed.

        Raises
        ------
        RecordingError
            When it cannot be written.
        """
        asked, points = self._asked, cloud.with_range()
        described: JsonObject
        with Recording.open(self._recording.path) as recording:
            check, on_s = zero.zero_check_of(recording), _laser_on(recording)
        left = range_error_left(self._range_error, cloud, self._recording.header.get("stretch"))
        options: RegisterOptions = {**self._options(zero.objections(check)), "range_bias_mm": left["sd_mm"]}
        began = time.perf_counter()
        try:
            result = register(
                points.points_mm,
                asked.model,
                covariance=points.covariance_mm2,
                response_mv=points.response_mv,
                grid=points.grid,
                **options,
            )
        except RegistrationError as error:
            described = {"verdict": "fail", "reasons": [str(error)], "model_from_scanner": None, "targets": []}
        else:
            took_ms = (time.perf_counter() - began) * 1e3
            tolerance = options.get("tolerance") or Tolerance()
            described = describe(result, tolerance, prepare_ms=asked.prepare_ms, register_ms=took_ms)
            described["covariance"], described["centre"] = result.covariance, result.centre
            for target, error_of in zip(described["targets"], result.targets, strict=True):
                target["tre_mm"] = tre_mm(error_of)
        described["lines_used"] = sorted({int(row) for row in cloud.rows})
        described["live"] = self._live_result(on_s)
        content = {**described, **self._digests(), "model": asked.model.name, "until_tre_mm": asked.until_tre_mm}
        Recording.add_registration(self._recording.path, content)
        return described

    def _options(self, objections: Sequence[Objection]) -> RegisterOptions:
        """Get what lines are registered with, whose ranges are not corrected by the stretch of their echoes."""
        return {**self._asked.options, "range_bias_mm": self._range_error["sd_mm"], "objections": objections}

    @property
    def _range_error(self) -> JsonObject:
        material, ranging = self._run.settings.scan.material, self._job.capture.ranging
        return self._run.calibration.range_error(material, ranging)._asdict()

    def _digests(self) -> JsonObject:
        return {
            "model_digest": self._asked.model.key,
            "settings_digest": digest(self._recording.header.get("settings")),
            "calibration_digest": self._recording.header.get("calibration_digest"),
        }

    def _live_result(self, on_s: float | None) -> JsonObject:
        """Describe how the pose was found while the scan was made; times in s of device time after the laser's on."""
        result = self.result

        def after(moment_s: float | None) -> float | None:
            return None if moment_s is None or on_s is None else round(moment_s - on_s, 6)

        return {
            "searches": result.searches,
            "lines": len(result.lines),
            "stage": result.stage,
            "pose_after_s": after(self._pose_s),
            "reached_after_s": after(self._reached_s),
            "verdict": result.verdict,
        }


def in_words(result: LiveResult) -> str:
    """Say in a few words what a live registration knows."""
    found = result.registration
    if found is None:
        return f"no pose yet ({result.why})"
    worst = max(found.targets, key=tre_mm, default=None)
    error = "" if worst is None else f", {tre_mm(worst):.2f} mm at {worst.name}"
    return f"{found.verdict}: {found.predicted_rotation_deg:.2f} deg{error} predicted (rms)"


def _laser_on(recording: Recording) -> float | None:
    return next((event.time_s for event in recording.events() if event.kind == LASER_ON), None)
