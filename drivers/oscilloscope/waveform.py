"""Waveforms of the 86100 family at the wire: blocks, preamble and codes as pure data.

Source: protocol sheet ``dca_scpi_waveform.md``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

HOLE = 31232  # from here on codes of WORD are not voltages
CLIPPED_LOW = 31744
CLIPPED_HIGH = 32256
MIN_CODE = -32768
MAX_CODE = HOLE - 1
WORD = 2  # format number in the preamble


class BadWaveform(ValueError):
    """A block or a preamble that is malformed."""


@dataclass(frozen=True)
class Preamble:
    """Scale of a waveform: the first ten fields of the preamble; a shorter or longer tail is tolerated.

    Attributes
    ----------
    format, kind, points, count : int
        Format (2 WORD), type (1 raw, 2 average), points, averages.
    x_increment, x_origin, x_reference : float
        Seconds; t(i) = (i - x_reference) x_increment + x_origin.
    y_increment, y_origin, y_reference : float
        Volts; v = (d - y_reference) y_increment + y_origin.
    """

    format: int
    kind: int
    points: int
    count: int
    x_increment: float
    x_origin: float
    x_reference: float
    y_increment: float
    y_origin: float
    y_reference: float

    @classmethod
    def decode(cls, text: str) -> Preamble:
        """Read the answer to ``:WAVeform:PREamble?``.

        Raises
        ------
        BadWaveform
        """
        fields = text.strip().split(",")
        if len(fields) < 10:
            raise BadWaveform(f"preamble of {len(fields)} fields, at least 10 needed: {text!r}")
        try:
            whole = [int(float(f)) for f in fields[:4]]
            real = [float(f) for f in fields[4:10]]
        except (ValueError, OverflowError) as error:
            raise BadWaveform(f"preamble {text!r}: {error}") from error
        if not all(map(np.isfinite, real)) or real[0] <= 0 or real[3] <= 0 or whole[2] < 1:
            raise BadWaveform(f"preamble without a usable scale: {text!r}")
        return cls(*whole, *real)

    def encode(self) -> str:
        """Get the ten fields as a device prints them."""
        whole = (self.format, self.kind, self.points, self.count)
        real = (self.x_increment, self.x_origin, self.x_reference, self.y_increment, self.y_origin, self.y_reference)
        return ",".join([*map(str, whole), *(f"{value:.9E}" for value in real)])

    def times_s(self) -> NDArray[np.float64]:
        """Get the (points,) sampling instants after the trigger, s."""
        return (np.arange(self.points, dtype=np.float64) - self.x_reference) * self.x_increment + self.x_origin

    def volts(self, codes: NDArray[np.int16]) -> NDArray[np.float64]:
        """Get the (points,) voltages; NaN for missing and clipped samples, whose codes are not voltages."""
        volts = (codes.astype(np.float64) - self.y_reference) * self.y_increment + self.y_origin
        volts[codes >= HOLE] = np.nan
        return volts


def encode_block(data: bytes) -> bytes:
    """Get a definite-length block with its LF."""
    length = str(len(data))
    return f"#{len(length)}{length}".encode("ascii") + data + b"\n"


def decode_block(message: bytes) -> bytes:
    """Get the data of a block that is a whole message.

    Raises
    ------
    BadWaveform
        When it is no block, or its length does not fit. A block of indefinite length (``#0``) is accepted, because the
        message has ended.
    """
    if len(message) < 2 or message[:1] != b"#" or not message[1:2].isdigit():
        raise BadWaveform(f"no block: begins with {message[:12]!r}")
    digits = int(message[1:2])
    if digits == 0:
        return message[2:].removesuffix(b"\n")
    number = message[2 : 2 + digits]
    if len(number) < digits or not number.isdigit():
        raise BadWaveform(f"no length of {digits} digits: begins with {message[:12]!r}")
    begin, end = 2 + digits, 2 + digits + int(number)
    if message[end:] != b"\n":  # without the final LF a byte may be missing
        raise BadWaveform(f"block says {int(number)} bytes, the message has {len(message) - begin}")
    return message[begin:end]


def decode_words(block: bytes, preamble: Preamble) -> NDArray[np.int16]:
    """Get the (points,) codes of a block of WORDs, least significant byte first.

    Parameters
    ----------
    block : bytes
        Two bytes per point.
    preamble : Preamble
        Scale and number of points.

    Raises
    ------
    BadWaveform
        When the preamble belongs to another block.
    """
    if preamble.format != WORD or len(block) != 2 * preamble.points:
        raise BadWaveform(
            f"{len(block)} bytes came for {preamble.points} points in format {preamble.format}; WORD is {WORD}"
        )
    return np.frombuffer(block, "<i2")
