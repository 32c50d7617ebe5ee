"""The oscilloscope's firmware: USBTMC, SCPI, waveforms."""

from picoradar.sim.firmware.oscilloscope.device import OscilloscopeFirmware

__all__ = [
    "OscilloscopeFirmware",
]
