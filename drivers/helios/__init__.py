"""The galvo controller Helios DAC: single positions and paths, over USB."""

from picoradar.drivers.helios.driver import Helios, helios_link
from picoradar.drivers.helios.wire import Answer, Command, FrameFlag, GalvoFrame

__all__ = [
    "Answer",
    "Command",
    "FrameFlag",
    "GalvoFrame",
    "Helios",
    "helios_link",
]
