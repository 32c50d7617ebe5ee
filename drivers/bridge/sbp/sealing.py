"""Sampling bridge protocol (SBP 1.0 and 1.1): what all control blocks have in common.

Source: protocol sheet ``sampling_bridge.md``, section 2: length, version and CRC-32 at the end.
"""

from __future__ import annotations

import struct
import zlib

from picoradar.drivers.bridge.sbp.codes import ErrorCode


class BadBlock(ValueError):
    """A block with a wrong length, version or check sum.

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

    Parameters
    ----------
    name : str
        Name of the block for messages.
    block : bytes
        With its CRC.

    Raises
    ------
    BadBlock
        When it does not fit.
    """
    expected, found = zlib.crc32(block[:-4]), int.from_bytes(block[-4:], "little")
    if expected != found:
        raise BadBlock(ErrorCode.BAD_CRC, f"{name}: CRC {found:#010x}, expected {expected:#010x}")


def open_block(name: str, data: bytes, magic: bytes, minimum: int) -> bytes:
    """Cut a block out of ``data`` by the length in its header, and check magic, version and CRC.

    Parameters
    ----------
    name : str
        Name of the block for messages.
    data : bytes
        What was received.
    magic : bytes
        First bytes of the block; empty for none.
    minimum : int
        Smallest length of the block.

    Raises
    ------
    BadBlock
        With the code of the first check that fails.
    """
    at = len(magic)
    if len(data) < minimum or data[:at] != magic:
        raise BadBlock(ErrorCode.BAD_LENGTH, f"{name}: {len(data)} bytes beginning with {data[:4].hex(' ')}")
    length, version = struct.unpack_from("<HH", data, at)
    if not minimum <= length <= len(data):
        raise BadBlock(ErrorCode.BAD_LENGTH, f"{name}: says {length} bytes, {len(data)} came, {minimum} are needed")
    if version >> 8 != 1:
        raise BadBlock(ErrorCode.BAD_VERSION, f"{name}: version {version >> 8}.{version & 255}, only 1.x is known")
    block = data[:length]
    check_crc(name, block)
    return block
