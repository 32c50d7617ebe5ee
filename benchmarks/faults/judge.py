"""Judging a run from outside: the light, the recording, and every point against the truth of the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.faults.result import Result
from picoradar.drivers.errors import DeviceError
from picoradar.instrument.controller import Controller
from picoradar.instrument.line import NO_RANGE, SUSPECT
from picoradar.instrument.recording import Recording, RecordingError

if TYPE_CHECKING:
    from benchmarks.faults.life import Life

WRONG_MM = 2.0  # six standard deviations of a sound point at this number of averages
WRONG_SD = 6.0  # or of the point's own stated standard deviation, where that is larger
DEVICE_LIMIT_S = 2400.0  # warm-up limit, suspensions of every line, and both limits of recovery


def judge(result: Result, life: Life) -> None:
    controller = life.controller
    result.state = controller.state
    result.cause = result.cause or controller.cause
    result.device_s = life.clock.now()
    result.lit = life.meter.is_lit()
    result.off_verified = controller.safe.laser_off_verified
    result.errors = life.errors
    result.struck_s = life.struck()
    if life.outcome is not None:
        result.suspensions = len(life.outcome.suspended)
    if result.device_s > DEVICE_LIMIT_S:
        result.defect += f"; took {result.device_s:.0f} s of device time"
    if controller.state == "fault" and not controller.cause:
        result.defect += "; fault without a cause"
    if result.off_verified and result.lit:
        result.defect += "; said off while there was light"
    if controller.state not in ("fault", "ready", "off", "connected"):
        result.defect += f"; left in state {controller.state}"
    _time_to_dark(result, life)
    if life.path.exists():
        _check_recording(result, life)
    _leave(result, controller)


def _time_to_dark(result: Result, life: Life) -> None:
    """Find how long light went on after the fault, and after the first sign of it."""
    struck = result.struck_s
    if struck is None or (result.state == "ready" and not result.suspensions):
        return
    signs = sorted([t for t, _ in life.errors] + life.off_s)
    for on_s, off_s in life.meter.times:
        if on_s <= struck <= off_s:
            result.fault_to_dark_s = off_s - struck
        seen = [t for t in signs if max(on_s, struck) <= t <= off_s]
        if seen:
            result.seen_to_dark_s = max(result.seen_to_dark_s or 0.0, off_s - seen[0])


def _check_recording(result: Result, life: Life) -> None:
    try:
        with Recording.open(life.path) as recording:
            sound = {check.index for check in recording.check() if check.ok}
            cloud = recording.cloud(skip_damaged=True)
    except RecordingError as error:
        result.defect += f"; the recording does not open: {error}"
        return
    result.lines = len(sound)
    result.lost = len(set(life.acknowledged) - sound)
    truth = {key[0]: seen.point_mm for key, seen in life.bench.optics.truth.items()}
    good = (cloud.flags & np.uint16(SUSPECT | NO_RANGE)) == 0
    limit_mm = np.maximum(WRONG_MM, WRONG_SD * np.sqrt(cloud.range_variance_mm2))
    places = cloud.rows.astype(int) * life.columns + cloud.columns + 1
    for place, point, most_mm in zip(places[good], cloud.points_mm[good], limit_mm[good], strict=True):
        true_mm = truth.get(int(place))
        if true_mm is None or not np.linalg.norm(point - true_mm) <= most_mm:
            result.wrong += 1


def _leave(result: Result, controller: Controller) -> None:
    try:
        if controller.state == "fault":
            controller.acknowledge()
        elif controller.state in ("connected", "ready", "warming"):
            controller.shut_down()
    except DeviceError as error:
        result.defect += f"; cannot leave: {error}"
