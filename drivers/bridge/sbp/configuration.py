"""Sampling bridge protocol (SBP 1.0 and 1.1): configuration block and window table.

Source: protocol sheet ``sampling_bridge.md``, sections 2.3 and 10.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from picoradar.drivers.bridge.sbp.codes import VERSION_1_0, VERSION_1_1, ConfigFlag, ErrorCode, Format
from picoradar.drivers.bridge.sbp.sealing import BadBlock, open_block, seal
from picoradar.drivers.traces import Window


@dataclass(frozen=True)
class Configuration:
    """Configuration block (section 2.3)."""

    start_fs: int
    step_fs: int
    samples: int
    averages: int
    flags: ConfigFlag
    records: int
    prf_hz: int
    format: int = Format.U16
    settle_shots: int = 0

    LENGTH = 40
    _BODY = struct.Struct("<HHQIIHHIIBBH")

    def encode(self) -> bytes:
        """Get the 40 bytes of the block."""
        return seal(
            self._BODY.pack(
                self.LENGTH,
                VERSION_1_0,
                self.start_fs,
                self.step_fs,
                self.samples,
                self.averages,
                int(self.flags),
                self.records,
                self.prf_hz,
                self.format,
                0,
                self.settle_shots,
            )
        )

    @classmethod
    def decode(cls, data: bytes) -> Configuration:
        """Read a block.

        Raises
        ------
        BadBlock
        """
        block = open_block("configuration block", data, b"", cls.LENGTH)
        _, _, start, step, samples, averages, flags, records, prf, form, _, settle = cls._BODY.unpack_from(block)
        return cls(start, step, samples, averages, ConfigFlag(flags), records, prf, form, settle)


@dataclass(frozen=True)
class WindowEntry:
    """One entry of the window table (section 10): a piece of the trace in whole femtoseconds, and its sweeps."""

    start_fs: int
    step_fs: int
    samples: int
    sweeps: int

    @classmethod
    def of(cls, window: Window) -> Self:
        """Round a window (ps) to the unit of the protocol."""
        return cls(femtoseconds(window.start_ps), femtoseconds(window.step_ps), window.samples, window.sweeps)


def femtoseconds(time_ps: float) -> int:
    """Round a time in ps to whole femtoseconds, the unit of the protocol."""
    return round(time_ps * 1000)


_ENTRY = struct.Struct("<QIHH")


def encode_windows(table: Sequence[Sequence[WindowEntry]]) -> bytes:
    """Get the block of SET_WINDOWS for records of equally many windows.

    Raises
    ------
    ValueError
        When the records do not all have the same number of windows, or there are none.
    """
    widths = {len(record) for record in table}
    if len(widths) != 1 or 0 in widths:
        raise ValueError(f"every record needs the same number of windows, at least 1; found {sorted(widths)}")
    entries = [window for record in table for window in record]
    body = struct.pack("<HHHH", 12 + 16 * len(entries), VERSION_1_1, widths.pop(), len(table))
    return seal(body + b"".join(_ENTRY.pack(w.start_fs, w.step_fs, w.samples, w.sweeps) for w in entries))


def decode_windows(data: bytes) -> list[tuple[WindowEntry, ...]]:
    """Read the block of SET_WINDOWS: one tuple of windows for each record.

    Raises
    ------
    BadBlock
    """
    block = open_block("window table", data, b"", 12)
    _, _, width, records = struct.unpack_from("<HHHH", block)
    if len(data) != len(block) or len(block) != 12 + 16 * width * records:
        raise BadBlock(ErrorCode.BAD_LENGTH, f"window table: {len(data)} bytes for {records} x {width} windows")
    entries = [WindowEntry(*fields) for fields in _ENTRY.iter_unpack(block[8:-4])]
    return [tuple(entries[m * width : (m + 1) * width]) for m in range(records)]
