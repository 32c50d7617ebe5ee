"""Sampling bridge protocol (SBP 1.0 and 1.1), wire half: requests, codes and control blocks as pure data.

All fields are little-endian, times are integer femtoseconds, every block ends with its CRC-32. Sources:
protocol sheet ``sampling_bridge.md``, sections 2, 4, 6 and 10. Frames are in `drivers.sbp_frames`.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag

VENDOR_ID = 0x1209
PRODUCT_ID = 0x0001
INTERFACE_CLASS = (0xFF, 0x53, 0x01)
EP_DATA = 0x81
EP_EVENT = 0x82
LASER_KEY = b"RSAL"
RESET_VALUE = 0xB0B0
VERSION_1_0 = 0x0100
VERSION_1_1 = 0x0101


class Request(IntEnum):
    """bRequest of the control requests."""

    GET_INFO = 0x01
    GET_CAPS = 0x02
    GET_STATUS = 0x03
    GET_ERROR = 0x04
    SET_CONFIG = 0x10
    GET_CONFIG = 0x11
    SET_WINDOWS = 0x12
    START = 0x20
    STOP = 0x21
    FLUSH = 0x22
    LASER = 0x30
    HEARTBEAT = 0x31
    SET_WATCHDOG = 0x32
    RESET = 0x3F


class ErrorCode(IntEnum):
    """Codes of the error queue."""

    OK = 0x00
    BAD_LENGTH = 0x01
    BAD_VERSION = 0x02
    BAD_CRC = 0x03
    UNKNOWN_REQUEST = 0x04
    BAD_VALUE = 0x05
    STEP_RANGE = 0x10
    STEP_RESOLUTION = 0x11
    COUNT_RANGE = 0x12
    WINDOW_RANGE = 0x13
    AVERAGES_RANGE = 0x14
    PRF_RANGE = 0x15
    FORMAT = 0x16
    FLAGS = 0x17
    SETTLE_RANGE = 0x18
    BUSY = 0x20
    NOT_CONFIGURED = 0x21
    LASER_LOCKED = 0x22
    INTERLOCK_OPEN = 0x23
    BAD_KEY = 0x24
    NO_HEARTBEAT = 0x25
    STALE_HEARTBEAT = 0x26
    OVERRUN = 0x30
    TRIGGER_LOST = 0x31
    TRIGGER_RATE = 0x32
    ADC_FAULT = 0x33
    DELAY_FAULT = 0x34
    WATCHDOG_TRIPPED = 0x35
    OVER_TEMPERATURE = 0x36
    ADVANCE_OVERRUN = 0x37
    QUEUE_FULL = 0x7E
    INTERNAL = 0x7F


class State(IntEnum):
    """State of the device in the status block."""

    IDLE = 0
    WAIT = 1
    RUNNING = 2
    STOPPING = 3
    FAULT = 4


class Gate(IntEnum):
    """State of the trigger gate."""

    OFF = 0
    ON = 1
    LOCKED = 2


class EventKind(IntEnum):
    """Kinds of events on the interrupt endpoint."""

    STATE = 1
    GATE = 2
    WATCHDOG = 3
    INTERLOCK = 4
    OVERRUN = 5
    TRIGGER_LOST = 6
    RECORD_DONE = 7
    ERROR = 8


class Format(IntEnum):
    """Sample formats: mean in 8 bits, or sum in 16 bits."""

    U8 = 0
    U16 = 1


class ConfigFlag(IntFlag):
    """Flags of the configuration block; the last two are of version 1.1."""

    EXTERNAL_TRIGGER = 1
    TEST_PATTERN = 2
    GATE_BETWEEN = 4
    WINDOWS = 8
    ADVANCE = 16


class StatusFlag(IntFlag):
    """Flags of the status block."""

    INTERLOCK_CLOSED = 1
    TRIGGER_PRESENT = 2
    FRAMES_LOST = 4
    WATCHDOG_TRIPPED = 8
    CLIPPING_SEEN = 16
    CONFIGURED = 32
    CLOCK_LOCKED = 64
    ERROR_QUEUED = 128


class Feature(IntFlag):
    """Feature bits of the identity block; the last two are of version 1.1."""

    AVERAGING = 1
    LASER_GATE = 2
    TEST_PATTERN = 4
    TRIGGER_COUNTER = 8
    WINDOWS = 16
    ADVANCE = 32


class BadBlock(ValueError):
    """A block that breaks its own rules.

    Attributes
    ----------
    code : ErrorCode
        BAD_LENGTH, BAD_VERSION or BAD_CRC.
    """

    def __init__(self, code: ErrorCode, what: str) -> None:
        super().__init__(what)
        self.code = code


def seal(body: bytes) -> bytes:
    """Append the CRC-32 of ``body``."""
    return body + struct.pack("<I", zlib.crc32(body))


def check_crc(name: str, block: bytes) -> None:
    """Check the CRC-32 in the last four bytes.

    Raises
    ------
    BadBlock
        When it does not fit.
    """
    expected, found = zlib.crc32(block[:-4]), int.from_bytes(block[-4:], "little")
    if expected != found:
        raise BadBlock(ErrorCode.BAD_CRC, f"{name}: CRC {found:#010x}, expected {expected:#010x}")


def _opened(name: str, data: bytes, magic: bytes, least: int) -> bytes:
    """Cut a block with the length it gives itself out of ``data``, and check magic, version and CRC."""
    at = len(magic)
    if len(data) < least or data[:at] != magic:
        raise BadBlock(ErrorCode.BAD_LENGTH, f"{name}: {len(data)} bytes beginning with {data[:4].hex(' ')}")
    length, version = struct.unpack_from("<HH", data, at)
    if not least <= length <= len(data):
        raise BadBlock(ErrorCode.BAD_LENGTH, f"{name}: says {length} bytes, {len(data)} came, at least {least} needed")
    if version >> 8 != 1:
        raise BadBlock(ErrorCode.BAD_VERSION, f"{name}: version {version >> 8}.{version & 255}, only 1.x is known")
    block = data[:length]
    check_crc(name, block)
    return block


@dataclass(frozen=True)
class Info:
    """Identity block (section 2.1)."""

    version: int
    hardware: int
    firmware: int
    serial_number: str
    model: str
    features: Feature

    _BODY = struct.Struct("<4sHHHH16s24sII")

    def encode(self) -> bytes:
        """Get the 64 bytes of the block."""
        text = (self.serial_number.encode("ascii"), self.model.encode("ascii"))
        return seal(
            self._BODY.pack(b"SLRB", 64, self.version, self.hardware, self.firmware, *text, int(self.features), 0)
        )

    @classmethod
    def decode(cls, data: bytes) -> Info:
        """Read a block; longer ones of later versions are accepted.

        Raises
        ------
        BadBlock
        """
        block = _opened("identity block", data, b"SLRB", 64)
        _, _, version, hardware, firmware, serial, model, features, _ = cls._BODY.unpack_from(block)
        return cls(version, hardware, firmware, _text(serial), _text(model), Feature(features))


@dataclass(frozen=True)
class Caps:
    """Capability block (section 2.2); the defaults are the reference device, version 1.0."""

    version: int = VERSION_1_0
    step_min_fs: int = 1_000
    step_max_fs: int = 100_000
    resolution_fs: int = 100
    depth: int = 16_384
    delay_max_fs: int = 4_000_000_000
    prf_min_hz: int = 20_000
    prf_max_hz: int = 240_000
    nv_per_code: int = 500_000
    zero_code: int = 32
    bits: int = 8
    formats: int = 3
    averages_max: int = 256
    watchdog_min_ms: int = 100
    watchdog_max_ms: int = 5_000
    payload_max: int = 4_096
    header_length: int = 48
    queue_depth: int = 64
    windows_max: int = 0
    entries_max: int = 0

    _BODY = struct.Struct("<4sHHIIIIQIIIHBBHHHHHH")
    _WINDOWS = struct.Struct("<HHHH")

    def encode(self) -> bytes:
        """Get the bytes of the block: 64, or 72 from version 1.1 on."""
        windows = self._WINDOWS.pack(self.windows_max, self.entries_max, 0, 0) if self.version >= VERSION_1_1 else b""
        fields = [getattr(self, name) for name in _CAPS_FIELDS[:-2]]
        return seal(self._BODY.pack(b"SLCP", self._BODY.size + len(windows) + 4, self.version, *fields) + windows)

    @classmethod
    def decode(cls, data: bytes) -> Caps:
        """Read a block; longer ones of later versions are accepted.

        Raises
        ------
        BadBlock
        """
        block = _opened("capability block", data, b"SLCP", 64)
        _, _, version, *fields = cls._BODY.unpack_from(block)
        windows: list[int] = [0, 0]
        if version >= VERSION_1_1 and len(block) >= cls._BODY.size + cls._WINDOWS.size + 4:
            windows = list(cls._WINDOWS.unpack_from(block, cls._BODY.size)[:2])
        return cls(**dict(zip(_CAPS_FIELDS, fields + windows, strict=True)), version=version)


_CAPS_FIELDS = tuple(Caps.__dataclass_fields__)[1:]  # in the order of the block; the last two are of version 1.1


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
        block = _opened("configuration block", data, b"", cls.LENGTH)
        _, _, start, step, samples, averages, flags, records, prf, form, _, settle = cls._BODY.unpack_from(block)
        return cls(start, step, samples, averages, ConfigFlag(flags), records, prf, form, settle)


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
        block = _opened("status block", data, b"", 32)
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


def error_name(code: int) -> str:
    """Get the name of an error code; its number when a later version made it."""
    try:
        return ErrorCode(code).name
    except ValueError:
        return f"error {code:#04x}"


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


@dataclass(frozen=True)
class Window:
    """One entry of the window table (section 10): a piece of the trace and its number of sweeps."""

    start_fs: int
    step_fs: int
    samples: int
    sweeps: int


_ENTRY = struct.Struct("<QIHH")


def encode_windows(table: Sequence[Sequence[Window]]) -> bytes:
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


def decode_windows(data: bytes) -> list[tuple[Window, ...]]:
    """Read the block of SET_WINDOWS: one tuple of windows for each record.

    Raises
    ------
    BadBlock
    """
    block = _opened("window table", data, b"", 12)
    _, _, width, records = struct.unpack_from("<HHHH", block)
    if len(data) != len(block) or len(block) != 12 + 16 * width * records:
        raise BadBlock(ErrorCode.BAD_LENGTH, f"window table: {len(data)} bytes for {records} x {width} windows")
    entries = [Window(*fields) for fields in _ENTRY.iter_unpack(block[8:-4])]
    return [tuple(entries[m * width : (m + 1) * width]) for m in range(records)]


def _text(field: bytes) -> str:
    return field.split(b"\0", 1)[0].decode("ascii", "replace")
