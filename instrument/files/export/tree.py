"""The common content of HDF5 and Zarr: a tree of two groups, ``points`` and (optionally) ``traces`` or ``windows``.

``points`` has the arrays of `npz`, one entry per point with a range. ``traces`` has one entry per point
of the scan, with a range or without: ``sums`` (M, S) of the A/D codes over ``sweeps`` sweeps, ``row``, ``column`` and
``flags``. Its attributes give the axis and the scale: the k-th sample is taken at start_ps + step_ps * k and is
(sums / sweeps - zero_code) * mv_per_code mV. A scan in windows has the group `windows` instead. The root carries the
recording's header as JSON text, and what is said about the points (`picoradar.instrument.files.about`).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, MutableMapping
from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.files.export.errors import ExportError
from picoradar.instrument.files.export.windows import window_arrays
from picoradar.instrument.recording import Recording

Arrays = dict[str, NDArray[np.generic]]


class Node(Protocol):
    """A group or an array, as h5py and zarr have them."""

    @property
    def attrs(self) -> MutableMapping[str, object]: ...
    def create_group(self, name: str) -> Self: ...
    def __getitem__(self, key: object, /) -> Self: ...
    def __setitem__(self, key: object, value: object, /) -> None: ...


G = TypeVar("G", bound=Node)
MakeArray = Callable[[G, str, tuple[int, ...], np.dtype[np.generic]], Node]
"""Makes an empty array from group, name, shape and dtype."""


@dataclass(frozen=True)
class Tree:
    """The points' arrays by name, and the recording that the traces are read from, line by line."""

    points: Arrays
    recording: Recording
    about: dict[str, str]
    traces: bool

    def write(self, root: G, make: MakeArray[G]) -> None:
        """Fill an empty root group."""
        root.attrs["header"] = json.dumps(self.recording.header, sort_keys=True)
        root.attrs.update(self.about)
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

    def held_by(self, root: Node) -> bool:
        """Return whether a root group reads back as this tree."""
        if any(root.attrs.get(name) != text for name, text in self.about.items()):
            return False
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

    def _write_windows(self, group: G, make: MakeArray[G]) -> None:
        for name in ("zero_code", "mv_per_code"):
            group.attrs[name] = self.recording.trace[name]
        for name, values in window_arrays(self.recording):
            make(group, name, values.shape, values.dtype)[...] = values

    def _trace_shapes(self) -> dict[str, tuple[tuple[int, ...], np.dtype[np.generic]]]:
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
                    raise ExportError(f"{self.recording.path}: was recorded without traces; leave out --waveforms")
                arrays["sums"] = line.sums
            yield place, arrays


def _same(found: object, meant: NDArray[np.generic]) -> bool:
    values = np.asarray(found)
    return values.dtype == meant.dtype and values.shape == meant.shape and values.tobytes() == meant.tobytes()
