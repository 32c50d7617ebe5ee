"""Links to the devices: serial ports by URL, USB and USBTMC, transcripts, retries, what to do when a port fails."""

from picoradar.drivers.links.controls import Control, Reading
from picoradar.drivers.links.numerals import read_number
from picoradar.drivers.links.serial import SerialLink
from picoradar.drivers.links.transcript import Event, Transcript, read_transcript
from picoradar.drivers.links.usb import UsbLink
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
    "BadHeader",
    "Capabilities",
    "Control",
    "ControlRequest",
    "Event",
    "Header",
    "MsgId",
    "Reading",
    "SerialLink",
    "TmcStatus",
    "Transcript",
    "UsbLink",
    "Usbtmc",
    "read_number",
    "read_transcript",
]
