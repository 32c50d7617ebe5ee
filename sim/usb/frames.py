"""Frames of the USB forwarding protocol: two lengths (u32, little endian), a JSON object, bytes."""

from __future__ import annotations

import json
import socket
import struct

from picoradar.drivers.errors import parse_json

Header = dict[str, object]
_LENGTHS = struct.Struct("<II")
LONGEST_HEADER = 1 << 20
LONGEST_DATA = 1 << 24


class BadFrame(OSError):
    """What came is no frame of this protocol."""


def encode_frame(header: Header, data: bytes = b"") -> bytes:
    """Make the bytes of one frame."""
    text = json.dumps(header).encode()
    return _LENGTHS.pack(len(text), len(data)) + text + data


def send_frame(connection: socket.socket, header: Header, data: bytes = b"") -> None:
    """Send one frame."""
    connection.sendall(encode_frame(header, data))


def receive_frame(connection: socket.socket) -> tuple[Header, bytes]:
    """Wait for one frame.

    Raises
    ------
    OSError
        When the connection is lost or too slow.
    BadFrame
        When it is no frame.
    """
    received = bytearray()
    while (frame := take_frame(received)) is None:
        chunk = connection.recv(1 << 16)
        if not chunk:
            raise ConnectionResetError("the other end has closed the connection")
        received += chunk
    return frame


def take_frame(received: bytearray) -> tuple[Header, bytes] | None:
    """Cut the first whole frame off what has been received; None when it is not all there.

    Raises
    ------
    BadFrame
        When it is no frame.
    """
    if len(received) < _LENGTHS.size:
        return None
    header_length, data_length = _LENGTHS.unpack_from(received)
    if header_length > LONGEST_HEADER or data_length > LONGEST_DATA:
        raise BadFrame(f"a frame of {header_length} + {data_length} bytes is too long")
    end = _LENGTHS.size + header_length + data_length
    if len(received) < end:
        return None
    data = bytes(received[_LENGTHS.size + header_length : end])
    try:
        header = parse_json(received[_LENGTHS.size : _LENGTHS.size + header_length])
    except ValueError as error:
        raise BadFrame(f"a frame with a damaged header: {error}") from error
    if not isinstance(header, dict):
        raise BadFrame("a frame whose header is no object")
    del received[:end]
    return header, data
