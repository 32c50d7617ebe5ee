"""A waveform in the memory of the simulated oscilloscope, and its output formats.

Source: protocol sheet ``dca_scpi_waveform.md``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.oscilloscope import CLIPPED_HIGH, CLIPPED_LOW, encode_block

MAX_CODE = 30_000  # of WORD, at the edge of the screen
_NUMBERS = {"ASC": 0, "BYTE": 1, "WORD": 2, "LONG": 3}
_STEPS = {"ASC": 1.0, "BYTE": 256.0, "WORD": 1.0, "LONG": 1 / 65536}  # of a code, in steps of WORD
_BYTE_HIGH, _BYTE_LOW = 127, 126
_ASCII_HIGH, _ASCII_LOW = "99.999E+33", "99.999E+30"


@dataclass(frozen=True)
class TakenWaveform:
    """Codes of WORD and their scale.

    Attributes
    ----------
    codes : (n,) int16 array
    sweeps : int
    x_increment, x_origin, y_increment, y_origin : float
        Seconds and volts; both references are 0.
    model : str
        Of the instrument, as in the preamble.
    """

    codes: NDArray[np.int16]
    sweeps: int
    x_increment: float
    x_origin: float
    y_increment: float
    y_origin: float
    model: str

    @classmethod
    def of_volts(
        cls,
        volts: NDArray[np.float64],
        clipped: tuple[NDArray[np.bool_], NDArray[np.bool_]],
        sweeps: int,
        x_axis: tuple[float, float],
        y_axis: tuple[float, float],
        model: str,
    ) -> TakenWaveform:
        """Digitise voltages.

        Parameters
        ----------
        volts : (n,) float array
        clipped : two (n,) bool arrays
            Samples that were clipped high and low before the digitiser.
        sweeps : int
        x_axis : increment, origin, s
        y_axis : half of the screen, voltage at its centre, V
        model : str
        """
        y_increment = y_axis[0] / MAX_CODE
        codes = np.round((volts - y_axis[1]) / y_increment)
        high = clipped[0] | (codes > MAX_CODE)
        low = clipped[1] | (codes < -MAX_CODE)
        words = np.where(high, CLIPPED_HIGH, np.where(low, CLIPPED_LOW, codes)).astype(np.int16)
        return cls(words, sweeps, *x_axis, y_increment, y_axis[1], model)

    def preamble(self, form: str) -> str:
        """Get the 25 fields of the preamble for a format."""
        points = len(self.codes)
        scale = (self.x_increment, self.x_origin, 0.0, self.y_increment * _STEPS[form], self.y_origin, 0.0)
        display = (points * self.x_increment, self.x_origin, 2 * MAX_CODE * self.y_increment, self.y_origin)
        fields = [
            *map(str, (_NUMBERS[form], 2 if self.sweeps > 1 else 1, points, self.sweeps)),
            *map(real, scale),
            "0",
            *map(real, display),
            '"01 JAN 2000"',
            '"00:00:00:00"',
            f'"{self.model}"',
            '"CH1"',
            *map(str, (2, 100, 2, 1)),
            "2.0E+10",
            "0.0E+00",
        ]
        return ",".join(fields)

    def data(self, form: str, byteorder: str) -> bytes:
        """Get the answer to ``:WAVeform:DATA?`` without its LF."""
        high, low = self.codes == CLIPPED_HIGH, self.codes == CLIPPED_LOW
        if form == "ASC":
            volts = (self.codes * self.y_increment + self.y_origin).tolist()
            marks = np.where(high, _ASCII_HIGH, np.where(low, _ASCII_LOW, "")).tolist()
            return ",".join(mark or real(v) for mark, v in zip(marks, volts, strict=True)).encode("ascii")
        order = "<" if byteorder == "LSBF" else ">"
        if form == "BYTE":
            raw = np.where(high, _BYTE_HIGH, np.where(low, _BYTE_LOW, self.codes >> 8)).astype("i1")
        elif form == "WORD":
            raw = self.codes.astype(f"{order}i2")
        else:
            raw = (self.codes.astype(np.int32) << 16).astype(f"{order}i4")
        return encode_block(raw.tobytes()).removesuffix(b"\n")


def real(value: float) -> str:
    """Get a number as the instrument prints it."""
    return f"{value:.9E}"
