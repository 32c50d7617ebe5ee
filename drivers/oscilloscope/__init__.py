"""A sampling oscilloscope as a second source of waveforms: USBTMC and SCPI."""

from picoradar.drivers.oscilloscope.driver import Oscilloscope, oscilloscope_link
from picoradar.drivers.oscilloscope.waveform import CLIPPED_HIGH, CLIPPED_LOW, encode_block

__all__ = [
    "CLIPPED_HIGH",
    "CLIPPED_LOW",
    "Oscilloscope",
    "encode_block",
    "oscilloscope_link",
]
