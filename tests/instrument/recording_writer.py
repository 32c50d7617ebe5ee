"""A program that writes lines to a recording as fast as it can and says on stdout which are acknowledged.

Started, and killed, by test_recording_crash.py and benchmarks/recording.py: ``python recording_writer.py FILE``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from instrument.recording import Recording
from instrument.scan_line import ScanLine

ROWS, COLUMNS, SAMPLES = 100_000, 40, 300


def make_line(index: int, columns: int = COLUMNS, samples: int = SAMPLES) -> ScanLine:
    """Return the line that every program makes of this index."""
    rng = np.random.default_rng(index)
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
        sums=rng.integers(0, 2040, (columns, samples)).astype(np.uint16),
        sweeps=8,
        device_time_s=float(index),
    )


def write_until_killed(path: Path) -> None:
    """Begin a recording or go on with it, for ever."""
    header = {"raster": {"rows": ROWS, "columns": COLUMNS}}
    recording = Recording.resume(path) if path.exists() else Recording.create(path, header)
    for index in range(len(recording.done), ROWS):
        recording.append(make_line(index))
        sys.stdout.write(f"{index}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    write_until_killed(Path(sys.argv[1]))
