"""A program that writes lines to a recording as fast as it can and says on stdout which are acknowledged.

Started, and killed, by test_recording_crash.py and benchmarks/recording.py: ``python recording_writer.py FILE``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import CodeScale, Trace
from picoradar.instrument.line import LineWindows, ScanLine
from picoradar.instrument.recording import Recording

ROWS, COLUMNS, SAMPLES = 100_000, 40, 300
FORM = {"start_ps": 6500.0, "step_ps": 6.7, "samples": SAMPLES, "zero_code": 40.0, "mv_per_code": 0.5}
SCALE = CodeScale(40.0, 0.5)


def trace_of(sums: NDArray[np.unsignedinteger]) -> Trace:
    """Return the traces of a line as `FORM` has them."""
    return Trace(sums, 8, 6500.0 + 6.7 * np.arange(SAMPLES), SCALE)


def make_line(index: int, columns: int = COLUMNS, samples: int = SAMPLES) -> ScanLine:
    """Return the line that every program makes of this index: with whole traces, and every third one with windows."""
    rng = np.random.default_rng(index)
    in_windows = index % 3 == 2
    return ScanLine(
        index=index,
        columns=np.arange(columns, dtype=np.int32),
        angles_rad=rng.normal(size=(columns, 2)),
        points_mm=rng.normal(size=(columns, 3)),
        covariance_mm2=rng.normal(size=(columns, 3, 3)),
        range_mm=rng.normal(size=columns),
        range_variance_mm2=rng.normal(size=columns),
        response_mv=rng.normal(size=columns),
        flags=np.zeros(columns, dtype=np.uint16),
        traces=None if in_windows else trace_of(rng.integers(0, 2040, (columns, samples)).astype(np.uint16)),
        sweeps=8,
        device_time_s=float(index),
        windows=make_windows(rng, columns, samples // 2) if in_windows else None,
    )


def make_windows(rng: np.random.Generator, columns: int, longest: int) -> LineWindows:
    """Return the raw windows of a line: each place once, and two of them again."""
    again = np.arange(min(2, columns))
    records = columns + len(again)
    samples = rng.integers(12, max(13, longest), (records, 2)).astype(np.int32)
    return LineWindows(
        columns=np.concatenate([np.arange(columns), again]).astype(np.int32),
        retaken=np.arange(records) >= columns,
        clipped=rng.random(records) < 0.1,
        start_ps=rng.integers(0, 4_000_000_000, (records, 2)) / 1000,
        step_ps=rng.integers(1000, 100_000, (records, 2)) / 1000,
        samples=samples,
        sweeps=rng.integers(1, 9, (records, 2)).astype(np.int32),
        sums=rng.integers(0, 2040, samples.sum()).astype(np.uint16),
        scale=SCALE,
    )


def write_until_killed(path: Path) -> None:
    """Begin a recording or go on with it, for ever."""
    header = {"raster": {"rows": ROWS, "columns": COLUMNS}, "trace": FORM}
    recording = Recording.resume(path) if path.exists() else Recording.create(path, header)
    for index in range(len(recording.done), ROWS):
        recording.append(make_line(index))
        sys.stdout.write(f"{index}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    write_until_killed(Path(sys.argv[1]))
