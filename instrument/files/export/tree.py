"""What HDF5 and Zarr hold alike: a tree of two groups, ``points`` and (if asked for) ``traces`` or ``windows``.

``points`` has the arrays of `npz`, one entry a place with a range. ``traces`` has one entry a place
of the scan, with a range or not: ``sums`` (M, S) of the A/D codes over ``sweeps`` sweeps, ``row``, ``column`` and
``flags``. Its attributes give the axis and the scale: the k-th sample is taken at start_ps + step_ps * k and is
(sums / sweeps - zero_code) * mv_per_code mV. A scan in windows has the group of `windows` in its
place. The root carries the recording's header as JSON text.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.files.export.errors import ExportError
from picoradar.instrument.files.export.windows import window_arrays
from picoradar.instrument.recording import Recording

Arrays = dict[str, NDArray[np.generic]]
MakeArray = Callable[[Any, str, tuple[int, ...], np.dtype[Any]], Any]
"""(group, name, shape, dtype) to an empty array that takes slices."""


@dataclass(frozen=True)
class Tree:
    """The points' arrays by name, and the recording that the traces are read from, line by line."""

    points: Arrays
    recording: Recording
    traces: bool

    def write(self, root: Any, make: MakeArray) -> None:
        """Fill an empty root group."""
        root.attrs["header"] = json.dumps(self.recording.header, sort_keys=True)
        points = root.create_group("points")
        for name, values in self.points.items():
            make(points, name, values.shape, values.dtype)[...] = values
        if not self.traces:
            return
        if self._windowed:
            self._write_windows(root.create_group("windows"), make)
            return
        group = root.create_group("traces")
        for name in ("start_ps", "step_ps", "zero_code", "mv_per_code"):
            group.attrs[name] = self.recording.trace[name]
        for name, (shape, dtype) in self._trace_shapes().items():
            make(group, name, shape, dtype)
        for place, arrays in self._blocks():
            for name, values in arrays.items():
                group[name][place] = values

    def held_by(self, root: Any) -> bool:
        """Return whether a root group reads back as this tree."""
        if not all(_same(root["points"][name][...], values) for name, values in self.points.items()):
            return False
        if not self.traces:
            return True
        if self._windowed:
            return all(_same(root["windows"][name][...], values) for name, values in window_arrays(self.recording))
        return all(
            _same(root["traces"][name][place], values)
            for place, arrays in self._blocks()
            for name, values in arrays.items()
        )

    @property
    def _windowed(self) -> bool:
        return any(self.recording.line(index).windows is not None for index in self.recording.done[:1])

    def _write_windows(self, group: Any, make: MakeArray) -> None:
        for name in ("zero_code", "mv_per_code"):
            group.attrs[name] = self.recording.trace[name]
        for name, values in window_arrays(self.recording):
            make(group, name, values.shape, values.dtype)[...] = values

    def _trace_shapes(self) -> dict[str, tuple[tuple[int, ...], np.dtype[Any]]]:
        first = next(self._blocks(), None)
        if first is None:
            raise ExportError(f"{self.recording.path}: holds no line, so there are no traces to export")
        total = sum(place.stop - place.start for place, _ in self._blocks(read_traces=False))
        return {name: ((total, *values.shape[1:]), values.dtype) for name, values in first[1].items()}

    def _blocks(self, *, read_traces: bool = True) -> Iterator[tuple[slice, Arrays]]:
        begin = 0
        for line in self.recording.lines(traces=read_traces):
            count = len(line.columns)
            place = slice(begin, begin + count)
            begin += count
            arrays: Arrays = {
                "row": np.full(count, line.index, dtype=np.int32),
                "column": line.columns,
                "flags": line.flags,
                "sweeps": np.full(count, line.sweeps, dtype=np.int32),
            }
            if read_traces:
                if line.sums is None:
                    raise ExportError(f"{self.recording.path}: was recorded without traces; leave --waveforms away")
                arrays["sums"] = line.sums
            yield place, arrays


def _same(found: Any, meant: NDArray[np.generic]) -> bool:
    values = np.asarray(found)
    return values.dtype == meant.dtype and values.shape == meant.shape and values.tobytes() == meant.tobytes()
