"""The identity of the simulated sampling bridge: USB descriptors, and identity and capability blocks by version."""

from __future__ import annotations

from picoradar.drivers.bridge import sbp
from picoradar.sim.usb import BULK, INTERRUPT, Configuration, Device, Endpoint, Interface

MODEL = "SLR sampling bridge"
CAPS_1_0 = sbp.Caps()
CAPS_1_1 = sbp.Caps(version=sbp.VERSION_1_1, header_length=52, windows_max=8, entries_max=252)
FEATURES_1_0 = sbp.Feature(0x0F)
FEATURES_1_1 = sbp.Feature(0x3F)


def descriptors(serial_number: str) -> Device:
    """Make the USB descriptors of a bridge."""
    endpoints = (Endpoint(sbp.EP_DATA, BULK, 512), Endpoint(sbp.EP_EVENT, INTERRUPT, 16, 6))  # 2**5 microframes: 4 ms
    klass, subclass, protocol = sbp.INTERFACE_CLASS
    interface = Interface(endpoints, 0, 0, klass, subclass, protocol)
    return Device(
        sbp.VENDOR_ID,
        sbp.PRODUCT_ID,
        0x0100,
        (Configuration((interface,), bmAttributes=0xC0, bMaxPower=0),),
        strings=("picoradar", MODEL, serial_number),
        iManufacturer=1,
        iProduct=2,
        iSerialNumber=3,
    )


def blocks(version: int, serial_number: str) -> tuple[sbp.Info, sbp.Caps]:
    """Make the identity and capability blocks for a protocol version.

    Parameters
    ----------
    version : int
        0x0100 or 0x0101.
    serial_number : str
        Up to 16 ASCII characters.

    Raises
    ------
    ValueError
        When there is no such version.
    """
    if version == sbp.VERSION_1_1:
        return sbp.Info(version, 1, 0x0102, serial_number, MODEL, FEATURES_1_1), CAPS_1_1
    if version == sbp.VERSION_1_0:
        return sbp.Info(version, 1, 0x0102, serial_number, MODEL, FEATURES_1_0), CAPS_1_0
    raise ValueError(f"protocol version {version:#06x} is not one of 0x0100 and 0x0101")
