"""Sampling bridge protocol (SBP 1.0 and 1.1): requests, states, flags and error codes.

Source: protocol sheet ``sampling_bridge.md``, sections 1, 2, 4, 6 and 10.
"""

from __future__ import annotations

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


def error_name(code: int) -> str:
    """Get the name of an error code; its number if it belongs to a later version."""
    try:
        return ErrorCode(code).name
    except ValueError:
        return f"error {code:#04x}"
