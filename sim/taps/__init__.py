"""Taps: each sits between two parts of the bench and passes everything on, until a fault installs a hook in it."""

from picoradar.sim.taps.physics import HeatPumpTap, MirrorsTap, SignalTap
from picoradar.sim.taps.serial import Pieces, SerialTap
from picoradar.sim.taps.usb import CONTROL_TIMEOUT_S, UsbTap

__all__ = [
    "CONTROL_TIMEOUT_S",
    "HeatPumpTap",
    "MirrorsTap",
    "Pieces",
    "SerialTap",
    "SignalTap",
    "UsbTap",
]
