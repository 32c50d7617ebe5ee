"""Sampling bridge protocol (SBP 1.0 and 1.1): status block, error queue and events.

Source: protocol sheet ``sampling_bridge.md``, sections 2, 2.4 and 4.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from picoradar.drivers.bridge.sbp.codes import VERSION_1_0, ErrorCode, EventKind, Gate, State, StatusFlag, error_name
from picoradar.drivers.bridge.sbp.sealing import BadBlock, open_block, seal


@dataclass(frozen=True)
class Status:
    """Status block (section 2.4)."""

    state: State
    gate: Gate
    flags: StatusFlag
    errors: int
    watchdog_ms: int
    run_id: int
    records: int
    frames_lost: int
    trigger_mhz: int
    version: int = VERSION_1_0

    _BODY = struct.Struct("<HHBBHHHIIII")

    def encode(self) -> bytes:
        """Get the 32 bytes of the block."""
        return seal(
            self._BODY.pack(
                32,
                self.version,
                self.state,
                self.gate,
                int(self.flags),
                self.errors,
                self.watchdog_ms,
                self.run_id,
                self.records,
                self.frames_lost,
                self.trigger_mhz,
            )
        )

    @classmethod
    def decode(cls, data: bytes) -> Status:
        """Read a block; longer ones of later versions are accepted.

        Raises
        ------
        BadBlock
        """
        block = open_block("status block", data, b"", 32)
        _, version, state, gate, flags, errors, left, run, records, lost, rate = cls._BODY.unpack_from(block)
        try:
            return cls(State(state), Gate(gate), StatusFlag(flags), errors, left, run, records, lost, rate, version)
        except ValueError as error:
            raise BadBlock(ErrorCode.BAD_VALUE, f"status block: {error}") from error


@dataclass(frozen=True)
class ErrorEntry:
    """One entry of the error queue (GET_ERROR)."""

    code: int
    request: int
    left: int
    detail: int

    _BODY = struct.Struct("<HBBI")

    def encode(self) -> bytes:
        """Get the 8 bytes of the entry."""
        return self._BODY.pack(self.code, self.request, self.left, self.detail)

    @classmethod
    def decode(cls, data: bytes) -> ErrorEntry:
        """Read an entry.

        Raises
        ------
        BadBlock
        """
        if len(data) != cls._BODY.size:
            raise BadBlock(ErrorCode.BAD_LENGTH, f"error entry: {len(data)} bytes, expected {cls._BODY.size}")
        return cls(*cls._BODY.unpack(data))

    def __str__(self) -> str:
        return f"{error_name(self.code)} (request {self.request:#04x}, detail {self.detail})"


@dataclass(frozen=True)
class Event:
    """One event of the interrupt endpoint (section 4)."""

    kind: EventKind
    error: int
    run_id: int
    argument: int
    time_ms: int

    LENGTH = 16
    _BODY = struct.Struct("<BBHIII")

    def encode(self) -> bytes:
        """Get the 16 bytes of the event."""
        return self._BODY.pack(0x53, self.kind, self.error, self.run_id, self.argument, self.time_ms)

    @classmethod
    def decode(cls, data: bytes) -> Event:
        """Read an event.

        Raises
        ------
        BadBlock
        """
        if len(data) != cls.LENGTH or data[0] != 0x53:
            raise BadBlock(ErrorCode.BAD_LENGTH, f"no event: {data.hex(' ')}")
        _, kind, *rest = cls._BODY.unpack(data)
        try:
            return cls(EventKind(kind), *rest)
        except ValueError as error:
            raise BadBlock(ErrorCode.BAD_VALUE, f"no event: {error}") from error
