"""USB devices of the simulated bench: descriptors, a bus that keeps honest time, and a pyusb backend."""

from picoradar.sim.usb.backend import SimUsbBackend
from picoradar.sim.usb.bus import InTransfer, SimUsbDevice
from picoradar.sim.usb.descriptors import (
    BULK,
    FULL_SPEED,
    HIGH_SPEED,
    INTERRUPT,
    ISOCHRONOUS,
    Configuration,
    Device,
    Endpoint,
    Interface,
)
from picoradar.sim.usb.firmware import Setup, UsbFirmware, UsbStall
from picoradar.sim.usb.frames import LONGEST_DATA, BadFrame, send_frame, take_frame

__all__ = [
    "BULK",
    "FULL_SPEED",
    "HIGH_SPEED",
    "INTERRUPT",
    "ISOCHRONOUS",
    "LONGEST_DATA",
    "BadFrame",
    "Configuration",
    "Device",
    "Endpoint",
    "InTransfer",
    "Interface",
    "Setup",
    "SimUsbBackend",
    "SimUsbDevice",
    "UsbFirmware",
    "UsbStall",
    "send_frame",
    "take_frame",
]
