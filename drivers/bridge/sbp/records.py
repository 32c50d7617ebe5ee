"""Assembles records from the frames of one run; never fills a gap.

Source: protocol sheet ``sampling_bridge.md``, section 3, framing rules 3 and 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.bridge.sbp.codes import Format
from picoradar.drivers.bridge.sbp.configuration import WindowEntry
from picoradar.drivers.bridge.sbp.frames import Frame, FrameFlag
from picoradar.drivers.bridge.sbp.identity import Caps
from picoradar.drivers.interfaces import Record, WindowRecord


class CorruptedRun(Exception):
    """Frames are missing, corrupted or do not belong together: the run has to be taken again."""


@dataclass
class RecordAssembler:
    """Takes the frames of a run in their order and returns whole records.

    Parameters
    ----------
    caps : Caps
        Scale of the A/D.
    run_id : int
        Frames of other runs are stale and are dropped.
    config_crc : int
        CRC of the configuration that the frames have to carry.
    table : sequence of sequences of WindowEntry
        Windows of each record; the last row applies to all further records.
    """

    caps: Caps
    run_id: int
    config_crc: int
    table: Sequence[Sequence[WindowEntry]]
    _sequence: int = 0
    _number: int = 0
    _frames: list[Frame] = field(default_factory=list)

    def add(self, frame: Frame) -> WindowRecord | None:
        """Take the next frame; returns the record that it completes, if it does.

        Raises
        ------
        CorruptedRun
            When a frame is missing before it, or it does not belong to what came before.
        """
        if frame.run_id != self.run_id:
            return None
        if frame.sequence != self._sequence:
            raise CorruptedRun(f"frame {self._sequence} of run {self.run_id} is missing: frame {frame.sequence} came")
        if frame.config_crc != self.config_crc:
            raise CorruptedRun(f"frame taken under configuration {frame.config_crc:#010x}, not {self.config_crc:#010x}")
        if frame.record != self._number or bool(frame.flags & FrameFlag.FIRST) != (not self._frames):
            raise CorruptedRun(f"frame of record {frame.record} came while record {self._number} was expected")
        self._sequence += 1
        self._frames.append(frame)
        if not frame.flags & FrameFlag.LAST:
            return None
        frames, self._frames = self._frames, []
        record = self._assemble(frames)
        self._number += 1
        return record

    def _assemble(self, frames: list[Frame]) -> WindowRecord:
        windows = self.table[min(self._number, len(self.table) - 1)]
        parts: list[list[Frame]] = [[] for _ in windows]
        for frame in frames:
            if frame.window >= len(windows):
                raise CorruptedRun(f"frame of window {frame.window}; the record has {len(windows)}")
            parts[frame.window].append(frame)
        records = tuple(self._trace(window, part) for window, part in zip(windows, parts, strict=True))
        return WindowRecord(self._number, records)

    def _trace(self, window: WindowEntry, frames: list[Frame]) -> Record:
        firsts = np.cumsum([0] + [len(f.samples) for f in frames])
        if [f.first for f in frames] != firsts[:-1].tolist() or firsts[-1] != window.samples:
            raise CorruptedRun(f"{firsts[-1]} of {window.samples} samples of record {self._number} came")
        if frames[0].sweeps != window.sweeps:
            raise CorruptedRun(f"{frames[0].sweeps} of {window.sweeps} sweeps of record {self._number} were taken")
        flags = 0
        for frame in frames:
            flags |= frame.flags
        means = frames[0].format == Format.U8
        sums: NDArray[np.unsignedinteger] = (
            frames[0].samples if len(frames) == 1 else np.concatenate([f.samples for f in frames])
        )
        return Record(
            run_id=self.run_id,
            number=self._number,
            sums=sums,
            sweeps=1 if means else window.sweeps,
            times_ps=(window.start_fs + window.step_fs * np.arange(window.samples)) / 1000.0,
            zero_code=float(self.caps.zero_code),
            mv_per_code=self.caps.nv_per_code * 1e-6,
            clipped=bool(flags & FrameFlag.CLIPPED),
            trigger_lost=bool(flags & FrameFlag.TRIGGER_LOST),
            device_time_us=frames[0].device_time_us,
        )
