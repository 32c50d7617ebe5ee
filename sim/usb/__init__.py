"""USB devices of the simulated bench: descriptors, a bus that keeps honest time, and a pyusb backend."""

from picoradar.sim.usb.backend import SimUsbBackend
from picoradar.sim.usb.bus import SimUsbDevice
from picoradar.sim.usb.firmware import Setup, UsbFirmware, UsbStall

__all__ = ["Setup", "SimUsbBackend", "SimUsbDevice", "UsbFirmware", "UsbStall"]
