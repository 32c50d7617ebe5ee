"""Sampling bridge protocol: data frames and the parser of their byte stream.

Source: protocol sheet ``sampling_bridge.md``, section 3 (frame layout and framing rules) and section 10
(the two fields that version 1.1 adds to the header).
"""

from __future__ import annotations

import struct
from enum import IntFlag
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.bridge.sbp.codes import Format

MAGIC = b"SLRF"
HEADER_1_0 = 48
HEADER_1_1 = 52
_FIELDS = struct.Struct("<4sBBBBIIIIHHQHhI")
_WINDOW = struct.Struct("<HH")
_CRC = struct.Struct("<I")
_DTYPES: dict[int, np.dtype[np.unsignedinteger]] = {
    Format.U8: np.dtype("<u1"),
    Format.U16: np.dtype("<u2"),
}
RESIDUE = 0x2144DF1C  # CRC-32 of anything that ends with its own CRC-32
_SHORTEST = 6  # bytes until the header's length is known


class FrameFlag(IntFlag):
    """Flags of a frame."""

    FIRST = 1
    LAST = 2
    CLIPPED = 4
    LOST_BEFORE = 8
    TRIGGER_LOST = 16
    END_OF_RUN = 32
    TEST_PATTERN = 64


class Frame(NamedTuple):
    """One data frame: header fields in their order, then window number (0 in version 1.0) and samples.

    Attributes
    ----------
    format, flags : int
        See `Format` and `FrameFlag`.
    sequence, run_id, record, first : int
        Frame number in the run, run, record number, and index of the first sample.
    device_time_us : int
        Start of the record since START.
    sweeps : int
        Sweeps actually averaged.
    temperature_cdegc : int
        Receiver temperature, 0.01 degC.
    config_crc : int
        CRC of the configuration in force.
    window : int
        Number of the window in the record.
    samples : (n,) uint8 or uint16 array
        A view of the received bytes.
    """

    format: int
    flags: int
    sequence: int
    run_id: int
    record: int
    first: int
    device_time_us: int
    sweeps: int
    temperature_cdegc: int
    config_crc: int
    window: int
    samples: NDArray[np.unsignedinteger]


def encode_frame(frame: Frame, header_length: int = HEADER_1_0) -> bytes:
    """Get the bytes of a frame; a header of 52 bytes carries the window number."""
    payload = frame.samples.astype(_DTYPES[frame.format], copy=False).tobytes()
    header = _FIELDS.pack(
        MAGIC,
        1,
        header_length,
        frame.format,
        frame.flags,
        frame.sequence,
        frame.run_id,
        frame.record,
        frame.first,
        len(frame.samples),
        len(payload),
        frame.device_time_us,
        frame.sweeps,
        frame.temperature_cdegc,
        frame.config_crc,
    )
    if header_length >= HEADER_1_1:
        header += _WINDOW.pack(frame.window, 0)
    return b"".join((header, _CRC.pack(crc32(header)), payload, _CRC.pack(crc32(payload))))


class FrameParser:
    """Finds frames in a byte stream; the result does not depend on how the stream is cut into reads.

    After a bad header the search continues one byte further on. A frame with a bad payload is dropped and the search
    continues behind its header, so that a frame that follows lost bytes is still found.

    Parameters
    ----------
    payload_max : int
        Largest payload that the device may send (capability block); anything longer is not a frame.

    Attributes
    ----------
    bad_headers, bad_payloads, skipped : int
        Headers and frames rejected so far, and bytes that belonged to no good frame.
    """

    def __init__(self, payload_max: int) -> None:
        self.payload_max = payload_max
        self.bad_headers = 0
        self.bad_payloads = 0
        self.skipped = 0
        self._rest = b""

    @property
    def damaged(self) -> int:
        """Get the number of headers and payloads rejected so far."""
        return self.bad_headers + self.bad_payloads

    @property
    def waiting(self) -> int:
        """Get the number of bytes kept because their frame is not complete yet."""
        return len(self._rest)

    def clear(self) -> None:
        """Discard the bytes that are kept."""
        self.skipped += len(self._rest)
        self._rest = b""

    def feed(self, data: bytes) -> list[Frame]:
        """Take the next bytes of the stream and return the frames that they complete."""
        stream = self._rest + data if self._rest else data
        view = memoryview(stream)
        frames: list[Frame] = []
        at = 0
        while True:
            found = stream.find(MAGIC, at)
            if found < 0:
                end = max(at, len(stream) - len(MAGIC) + 1)
                while end < len(stream) and not MAGIC.startswith(stream[end:]):
                    end += 1
                self.skipped += end - at
                break
            self.skipped += found - at
            at = end = found
            if len(stream) - at < _SHORTEST:
                break
            header_length = stream[at + 5]
            if stream[at + 4] != 1 or header_length < HEADER_1_0:
                at = self._no_header(at)
                continue
            payload_at = at + header_length
            if len(stream) < payload_at:
                break
            if crc32(view[at:payload_at]) != RESIDUE:
                at = self._no_header(at)
                continue
            _, _, _, form, flags, sequence, run, record, first, samples, length, time_us, sweeps, degc, config = (
                _FIELDS.unpack_from(stream, at)
            )
            if length > self.payload_max or form > Format.U16 or length != samples * (form + 1):
                at = self._no_header(at)
                continue
            frame_end = payload_at + length + 4
            if len(stream) < frame_end:
                break
            if crc32(view[payload_at:frame_end]) != RESIDUE:
                self.bad_payloads += 1
                self.skipped += header_length
                at = payload_at
                continue
            window = _WINDOW.unpack_from(stream, at + 44)[0] if header_length >= HEADER_1_1 else 0
            values = np.frombuffer(stream, _DTYPES[form], samples, payload_at)
            fields = (form, flags, sequence, run, record, first, time_us, sweeps, degc, config, window, values)
            frames.append(Frame._make(fields))
            at = frame_end
        self._rest = stream[end:]
        return frames

    def _no_header(self, at: int) -> int:
        self.bad_headers += 1
        self.skipped += 1
        return at + 1
