"""One record of the sampling bridge: its shots, its codes, and the frames that carry them.

Source: protocol sheet ``sampling_bridge.md``, sections 2.3, 3 and 10.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.bridge.sbp import ConfigFlag, Configuration, Format, Frame, FrameFlag, Gate, WindowEntry
from picoradar.sim.firmware.bridge.gate import TriggerGate
from picoradar.sim.wires import Acquisition, SignalSource


@dataclass(frozen=True)
class Record:
    """A record that is being taken.

    Attributes
    ----------
    run_id, repeat, number : int
        Run id, number of earlier deliveries of this run id, and record number.
    windows : tuple of WindowEntry
        A record of version 1.0 is one window.
    configuration : Configuration
    config_crc : int
    run_start_s, start_s : float
        Clock time of START and of the first shot.
    prf_hz : float
        Shots per second.
    flags : FrameFlag
        Flags of all its frames.
    """

    run_id: int
    repeat: int
    number: int
    windows: tuple[WindowEntry, ...]
    configuration: Configuration
    config_crc: int
    run_start_s: float
    start_s: float
    prf_hz: float
    flags: FrameFlag

    @property
    def end_s(self) -> float:
        """Get the clock time when the last shot has been fired."""
        return self.start_s + sum(w.sweeps * self._per_sweep(w) for w in self.windows) / self.prf_hz

    def pieces(self, now_s: float) -> Iterator[tuple[int, WindowEntry, int, float]]:
        """Yield number, window, sweeps completed until ``now_s`` and start (s) of each window that has any."""
        shots = int((now_s - self.start_s) * self.prf_hz + 1e-3)
        start_s = self.start_s
        for number, window in enumerate(self.windows):
            per_sweep = self._per_sweep(window)
            sweeps = min(window.sweeps, shots // per_sweep)
            if sweeps > 0:
                yield number, window, sweeps, start_s
            shots -= window.sweeps * per_sweep
            start_s += window.sweeps * per_sweep / self.prf_hz

    def _per_sweep(self, window: WindowEntry) -> int:
        return self.configuration.settle_shots + window.samples


class WindowTable:
    """Windows of the records to come, a row a record.

    Attributes
    ----------
    row : int
        Of the next record.
    """

    def __init__(self) -> None:
        self.row = 0
        self._rows: list[tuple[WindowEntry, ...]] = []

    def fill(self, rows: list[tuple[WindowEntry, ...]]) -> None:
        """Begin with other rows."""
        self._rows, self.row = rows, 0

    def windows(self, c: Configuration | None) -> tuple[WindowEntry, ...]:
        """Get the windows of the next record under a configuration; empty when the table is used up."""
        if c is None:
            return ()
        if c.flags & ConfigFlag.WINDOWS:
            return self._rows[self.row] if self.row < len(self._rows) else ()
        return (WindowEntry(c.start_fs, c.step_fs, c.samples, c.averages),)


class RecordTaker:
    """Turns a record into frames.

    Parameters
    ----------
    source : SignalSource
        Photodiode, bridge and A/D.
    gate : TriggerGate
        Whether the laser was on.
    payload_max : int
        Largest payload of a frame, bytes.

    Attributes
    ----------
    clipping_seen : bool
        Whether any sample was clipped since this was last set to False.
    temperature_degc : float
        Of the receiver.
    """

    def __init__(self, source: SignalSource, gate: TriggerGate, payload_max: int) -> None:
        self.clipping_seen = False
        self.temperature_degc = 23.0
        self._source = source
        self._gate = gate
        self._payload_max = payload_max

    def frames(self, record: Record, now_s: float) -> list[Frame]:
        """Get the frames of the sweeps completed until ``now_s``."""
        frames = [
            frame
            for number, window, sweeps, start_s in record.pieces(now_s)
            for frame in self._window_frames(
                record, number, sweeps, *self._sums(record, number, window, sweeps, start_s)
            )
        ]
        if frames:
            frames[0] = frames[0]._replace(flags=frames[0].flags | FrameFlag.FIRST)
            frames[-1] = frames[-1]._replace(flags=frames[-1].flags | FrameFlag.LAST)
        return frames

    def _sums(
        self, record: Record, number: int, window: WindowEntry, sweeps: int, start_s: float
    ) -> tuple[NDArray[np.uint32], FrameFlag]:
        """Get the sums of the codes of one window, and the flags of its frames."""
        if record.configuration.flags & ConfigFlag.TEST_PATTERN:
            codes = np.arange(window.samples)[None, :] + np.arange(sweeps)[:, None]
            return (codes % 256).sum(axis=0).astype(np.uint32), FrameFlag.TEST_PATTERN
        sums = self._source.acquire(
            Acquisition(
                key=(record.run_id, record.repeat, record.number, number),
                start_s=start_s,
                prf_hz=record.prf_hz,
                delay_ps=window.start_fs / 1000,
                step_ps=window.step_fs / 1000,
                samples=window.samples,
                sweeps=sweeps,
                settle_shots=record.configuration.settle_shots,
                gate_open=self._gate.state is Gate.ON and self._gate.changed_at <= record.start_s,
            )
        )
        clipped = self._source.clipped
        self.clipping_seen = self.clipping_seen or clipped
        return sums, FrameFlag.CLIPPED if clipped else FrameFlag(0)

    def _window_frames(
        self, record: Record, number: int, sweeps: int, sums: NDArray[np.uint32], flags: FrameFlag
    ) -> Iterator[Frame]:
        form = record.configuration.format
        values = (2 * sums + sweeps) // (2 * sweeps) if form == Format.U8 else sums
        per_frame = self._payload_max // (form + 1)
        for first in range(0, len(values), per_frame):
            yield Frame(
                format=form,
                flags=int(flags | record.flags),
                sequence=0,  # the queue counts
                run_id=record.run_id,
                record=record.number,
                first=first,
                device_time_us=round((record.start_s - record.run_start_s) * 1e6),
                sweeps=sweeps,
                temperature_cdegc=round(self.temperature_degc * 100),
                config_crc=record.config_crc,
                window=number,
                samples=values[first : first + per_frame],
            )
