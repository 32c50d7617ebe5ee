"""Links to the devices: serial ports by URL, USB and USBTMC; sessions, transcripts, retries, remedies."""

from picoradar.drivers.links.addresses import checked_address
from picoradar.drivers.links.controls import Control, Reading
from picoradar.drivers.links.numerals import read_number
from picoradar.drivers.links.serial import SerialLink
from picoradar.drivers.links.session import LATE_S, SerialSession
from picoradar.drivers.links.transcript import Event, EventDetails, InterfaceDetails, Transcript, read_transcript
from picoradar.drivers.links.usb import UsbLink
from picoradar.drivers.links.usb_find import UsbIdentity
from picoradar.drivers.links.usbtmc import Usbtmc
from picoradar.drivers.links.usbtmc_wire import (
    INTERFACE_CLASS,
    BadHeader,
    Capabilities,
    ControlRequest,
    Header,
    MsgId,
    TmcStatus,
)

__all__ = [
    "INTERFACE_CLASS",
    "LATE_S",
    "BadHeader",
    "Capabilities",
    "Control",
    "ControlRequest",
    "Event",
    "EventDetails",
    "Header",
    "InterfaceDetails",
    "MsgId",
    "Reading",
    "SerialLink",
    "SerialSession",
    "TmcStatus",
    "Transcript",
    "UsbIdentity",
    "UsbLink",
    "Usbtmc",
    "checked_address",
    "read_number",
    "read_transcript",
]
