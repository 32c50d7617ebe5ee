"""Helios laser DAC at the wire: commands, answers and frames as pure data.

Source: protocol sheet ``helios_dac.md`` (SDK version 11, firmware version 6).
"""

from __future__ import annotations

import struct
from enum import IntEnum, IntFlag
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

VENDOR_ID = 0x1209
PRODUCT_ID = 0xE500
EP_FRAME = 0x02
EP_COMMAND = 0x06
EP_ANSWER = 0x83
ANSWER_SIZE = 32

CODES = 4096
CENTRE = CODES // 2
RATE_MIN_HZ = 7
RATE_MAX_HZ = 65535
POINTS_MAX = 4095
PACKET = 64
NAME_MAX = 20
SDK_VERSION = 11


class Command(IntEnum):
    """Commands of the interrupt endpoint.

    These are all that can be sent: the command that erases the firmware is missing on purpose, and
    `encode_command` accepts nothing else.
    """

    STOP = 0x01
    SHUTTER = 0x02
    STATUS = 0x03
    FIRMWARE = 0x04
    NAME = 0x05
    SET_NAME = 0x06
    SDK_VERSION = 0x07


class Answer(IntEnum):
    """First byte of the answers: that of the command, with the high bit set."""

    STATUS = 0x83
    FIRMWARE = 0x84
    NAME = 0x85


class FrameFlag(IntFlag):
    """Last byte of a frame."""

    START_AT_ONCE = 1
    PLAY_ONCE = 2
    DO_NOT_BLOCK = 4


class GalvoFrame(NamedTuple):
    """Points for the mirrors.

    Attributes
    ----------
    xy : (n, 2) uint16 array
        Codes 0..4095, centre 2048.
    colours : (n, 4) uint8 array
        Red, green, blue, intensity.
    rate_hz : int
        Points per second, 7 to 65535.
    flags : FrameFlag
    """

    xy: NDArray[np.uint16]
    colours: NDArray[np.uint8]
    rate_hz: int
    flags: FrameFlag


def encode_command(command: Command, argument: int = 0) -> bytes:
    """Get the two bytes of a command.

    Raises
    ------
    ValueError
        When ``command`` is not a member of `Command`.
    """
    return bytes([Command(command), argument])


def encode_name(name: str) -> bytes:
    """Get the bytes that set the device's name.

    Raises
    ------
    ValueError
        When it is empty, longer than 20 characters, or not ASCII.
    """
    if not 0 < len(name) <= NAME_MAX or not name.isascii() or not name.isprintable():
        raise ValueError(f"a name has 1 to {NAME_MAX} printable ASCII characters; {name!r} has not")
    return bytes([Command.SET_NAME]) + name.encode("ascii") + b"\0"


def decode_name(text: bytes) -> str:
    """Get the name from its bytes, up to the NUL."""
    return text.split(b"\0", 1)[0].decode("ascii", "replace")


def encode_frame(frame: GalvoFrame) -> bytes:
    """Get the bytes of a frame: 7 for each point and 5 at the end.

    A frame must not be a multiple of 64 bytes long (n mod 64 = 45 points), because no zero-length packet
    follows it: as in the SDK, the last point is then left out and the rate scaled.
    """
    n = len(frame.xy)
    rate_hz = frame.rate_hz
    if (7 * n + 5) % PACKET == 0:
        rate_hz = round(rate_hz * (n - 1) / n)
        n -= 1
    x, y = frame.xy[:n].astype(np.uint16).T
    points = np.empty((n, 7), np.uint8)
    points[:, 0] = x >> 4
    points[:, 1] = (x & 0xF) << 4 | y >> 8
    points[:, 2] = y & 0xFF
    points[:, 3:] = frame.colours[:n]
    return points.tobytes() + struct.pack("<HHB", rate_hz, n, frame.flags)


def decode_frame(data: bytes) -> GalvoFrame | None:
    """Read a frame; None when its length does not fit the number of points in its trailer."""
    if len(data) < 5:
        return None
    rate_hz, n, flags = struct.unpack_from("<HHB", data, len(data) - 5)
    if n == 0 or len(data) != 7 * n + 5:
        return None
    points = np.frombuffer(data, np.uint8, 7 * n).reshape(n, 7)
    high = points[:, :3].astype(np.uint16)
    xy = np.column_stack([high[:, 0] << 4 | high[:, 1] >> 4, (high[:, 1] & 0xF) << 8 | high[:, 2]])
    return GalvoFrame(xy, points[:, 3:], rate_hz, FrameFlag(flags & 7))


def point_frame(x_code: int, y_code: int, *, points: int = 10, rate_hz: int = 20_000) -> GalvoFrame:
    """Make the frame that sends the beam to one position: identical dark points, played once."""
    xy = np.tile(np.array([x_code, y_code], np.uint16), (points, 1))
    return GalvoFrame(xy, np.zeros((points, 4), np.uint8), rate_hz, FrameFlag.PLAY_ONCE)


def path_frame(xy: ArrayLike, marked: ArrayLike, rate_hz: int) -> GalvoFrame:
    """Make a frame that is played once along a path and raises the marker line at some of its points.

    Where the frame would be a whole number of packets long (see `encode_frame`), its last point is doubled.

    Parameters
    ----------
    xy : (n, 2) array of int
        Codes 0..4095.
    marked : (n,) array of bool
        Where the blue line is high.
    rate_hz : int
        Points per second.

    Raises
    ------
    ValueError
        When a code, the number of points or the rate is out of range.
    """
    codes = np.asarray(xy)
    marks = np.asarray(marked, bool)
    if codes.ndim != 2 or codes.shape[1] != 2 or marks.shape != codes.shape[:1]:
        raise ValueError(f"xy is (n, 2) and marked (n,), not {codes.shape} and {marks.shape}")
    if not 1 <= len(codes) <= POINTS_MAX:
        raise ValueError(f"a frame has 1 to {POINTS_MAX} points, not {len(codes)}")
    if codes.min() < 0 or codes.max() >= CODES:
        raise ValueError(f"codes {codes.min()} to {codes.max()} are not all within 0 to {CODES - 1}")
    if not RATE_MIN_HZ <= rate_hz <= RATE_MAX_HZ:
        raise ValueError(f"rate {rate_hz} points/s is outside {RATE_MIN_HZ} to {RATE_MAX_HZ}")
    if (7 * len(codes) + 5) % PACKET == 0:
        codes, marks = np.append(codes, codes[-1:], axis=0), np.append(marks, marks[-1:])
    colours = np.zeros((len(codes), 4), np.uint8)
    colours[:, 2] = np.where(marks, 255, 0)
    return GalvoFrame(codes.astype(np.uint16), colours, rate_hz, FrameFlag.PLAY_ONCE)
