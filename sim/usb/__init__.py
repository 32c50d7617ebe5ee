"""USB devices of the simulated bench: descriptors, a bus with realistic timing, and a pyusb backend."""

from picoradar.sim.usb.backend import SimUsbBackend, UsbHandle
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
from picoradar.sim.usb.frames import LONGEST_DATA, BadFrame, Header, send_frame, take_frame

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
    "Header",
    "InTransfer",
    "Interface",
    "Setup",
    "SimUsbBackend",
    "SimUsbDevice",
    "UsbFirmware",
    "UsbHandle",
    "UsbStall",
    "send_frame",
    "take_frame",
]
