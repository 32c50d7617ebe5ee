"""The raw windows of a scan as plain arrays.

One entry per window, two windows per record (reference, then echo): ``row``, ``column``, ``echo`` (0 or 1),
``retaken``, ``clipped``, ``start_fs``, ``step_fs``, ``samples``, ``sweeps``, and ``first``, where its samples begin in
``sums``: the sums of the A/D codes of all windows, one after the other. The k-th sample of a window was taken
start_fs + step_fs * k after the trigger and is (sums[first + k] / sweeps - zero_code) * mv_per_code mV.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.files.export.errors import ExportError
from picoradar.instrument.line import PULSES, LineWindows
from picoradar.instrument.recording import Recording, in_fs


def window_arrays(recording: Recording) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Yield name and content of each array.

    Raises
    ------
    ExportError
        If a line was recorded without its windows.
    """
    lines: list[LineWindows] = []
    rows = []
    for line in recording.lines():
        if line.windows is None:
            raise ExportError(f"{recording.path}: line {line.index} was recorded without its windows")
        lines.append(line.windows)
        rows.append(np.full(PULSES * len(line.windows), line.index, dtype=np.int32))
    samples = np.concatenate([windows.samples.ravel() for windows in lines])
    yield "row", np.concatenate(rows)
    yield "echo", (np.arange(len(samples)) % PULSES).astype(np.uint8)
    for name, kind in (("column", np.int32), ("retaken", np.uint8), ("clipped", np.uint8)):
        values = [getattr(windows, "columns" if name == "column" else name) for windows in lines]
        yield name, np.repeat(np.concatenate(values), PULSES).astype(kind)
    yield "start_fs", np.concatenate([in_fs(windows.start_ps).ravel() for windows in lines])
    yield "step_fs", np.concatenate([in_fs(windows.step_ps).ravel() for windows in lines])
    yield "sweeps", np.concatenate([windows.sweeps.ravel() for windows in lines])
    yield "samples", samples
    yield "first", np.cumsum(samples, dtype=np.int64) - samples
    yield "sums", np.concatenate([windows.sums for windows in lines])
