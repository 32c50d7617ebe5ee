"""Range a recording again, from its raw traces, with another estimator or another calibration."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from instrument.calibration import Calibration, Method
from instrument.errors import BadInput
from instrument.ranging import estimate
from instrument.recording import Recording
from instrument.scan import to_scan_line
from instrument.scan_line import ScanLine


def rerange(
    source: Path,
    target: Path,
    *,
    method: Method | None = None,
    calibration: Calibration | None = None,
    on_line: Callable[[ScanLine], None] | None = None,
) -> None:
    """Write a new recording with the traces of an old one and new ranges.

    Parameters
    ----------
    source, target : Path
        Recording with raw traces; recording to make.
    method : {"half-maximum", "template"}, optional
        Estimator; the recording's own by default.
    calibration : Calibration, optional
        The recording's own by default.
    on_line : callable, optional
        Called with each line done.

    Raises
    ------
    BadInput
        When the recording holds no raw traces, or the calibration lacks what the estimator needs.
    RecordingError
        When the source is damaged or the target exists.
    """
    with Recording.open(source) as old:
        used = calibration or _own_calibration(old)
        estimator = method or old.header.get("raster", {}).get("estimator", "half-maximum")
        header = _header(old.header, source, used, estimator)
        with Recording.create(target, header) as new:
            for line in old.lines():
                again = _range_line(old, line, estimator, used)
                new.append(again)
                if on_line is not None:
                    on_line(again)
            new.finish(
                f"ranged again from {source.name} ({old.stop_reason})",
                laser_off_verified=bool(old.laser_off_verified),
            )


def _range_line(recording: Recording, line: ScanLine, method: Method, calibration: Calibration) -> ScanLine:
    if line.sums is None:
        raise BadInput(
            f"{recording.path}: line {line.index} has no raw traces; only scans that keep them can be reranged"
        )
    ranges = estimate(
        recording.traces_mv(line), recording.times_ps, method=method, calibration=calibration, sweeps=line.sweeps
    )
    return to_scan_line(
        line.index,
        line.columns,
        line.angles_rad,
        ranges,
        calibration,
        sums=line.sums,
        sweeps=line.sweeps,
        began_s=line.device_time_s,
    )


def _own_calibration(recording: Recording) -> Calibration:
    content = recording.header.get("calibration")
    if not isinstance(content, dict):
        raise BadInput(f"{recording.path}: holds no calibration; give one with --calibration")
    return Calibration.model_validate(content)


def _header(old: dict[str, Any], source: Path, calibration: Calibration, method: Method) -> dict[str, Any]:
    kept = {key: value for key, value in old.items() if key not in ("versions", "calibration_digest")}
    return {
        **kept,
        "raster": {**old["raster"], "estimator": method},
        "calibration": calibration.model_dump(mode="json"),
        "calibration_digest": calibration.digest,
        "ranged_from": {"recording": source.name, "versions": old.get("versions")},
    }
