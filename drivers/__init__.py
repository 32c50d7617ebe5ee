"""Drivers of the radar's devices, one folder each; links, interfaces, clock and errors. They know nothing of the rest.

The names below are what a program of your own needs; each is imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from picoradar._lazy import lazy_names

if TYPE_CHECKING:
    from picoradar.drivers.bridge import SamplingBridge, bridge_link
    from picoradar.drivers.clock import Clock, ScaledClock, VirtualClock
    from picoradar.drivers.dg645 import DG645
    from picoradar.drivers.errors import DeviceError, DeviceFault, LimitError, LinkLost, ProtocolError, Stall, Timeout
    from picoradar.drivers.genesys import Genesys
    from picoradar.drivers.helios import Helios, helios_link
    from picoradar.drivers.interfaces import Identity, Record, SweepSettings, WindowRecord
    from picoradar.drivers.links import SerialLink, Transcript, UsbIdentity, UsbLink, Usbtmc, read_transcript
    from picoradar.drivers.mecom import Tec
    from picoradar.drivers.oscilloscope import Oscilloscope, oscilloscope_link
    from picoradar.drivers.pulser import Pulser
    from picoradar.drivers.tc200 import TC200

__all__ = [
    "DG645",
    "TC200",
    "Clock",
    "DeviceError",
    "DeviceFault",
    "Genesys",
    "Helios",
    "Identity",
    "LimitError",
    "LinkLost",
    "Oscilloscope",
    "ProtocolError",
    "Pulser",
    "Record",
    "SamplingBridge",
    "ScaledClock",
    "SerialLink",
    "Stall",
    "SweepSettings",
    "Tec",
    "Timeout",
    "Transcript",
    "UsbIdentity",
    "UsbLink",
    "Usbtmc",
    "VirtualClock",
    "WindowRecord",
    "bridge_link",
    "helios_link",
    "oscilloscope_link",
    "read_transcript",
]

_HOMES = {
    "Clock": "clock",
    "DG645": "dg645",
    "DeviceError": "errors",
    "DeviceFault": "errors",
    "Genesys": "genesys",
    "Helios": "helios",
    "Identity": "interfaces",
    "LimitError": "errors",
    "LinkLost": "errors",
    "Oscilloscope": "oscilloscope",
    "ProtocolError": "errors",
    "Pulser": "pulser",
    "Record": "interfaces",
    "SamplingBridge": "bridge",
    "ScaledClock": "clock",
    "SerialLink": "links",
    "Stall": "errors",
    "SweepSettings": "interfaces",
    "TC200": "tc200",
    "Tec": "mecom",
    "Timeout": "errors",
    "Transcript": "links",
    "UsbIdentity": "links",
    "UsbLink": "links",
    "Usbtmc": "links",
    "VirtualClock": "clock",
    "WindowRecord": "interfaces",
    "bridge_link": "bridge",
    "helios_link": "helios",
    "oscilloscope_link": "oscilloscope",
    "read_transcript": "links",
}

__getattr__, __dir__ = lazy_names(__name__, _HOMES)
