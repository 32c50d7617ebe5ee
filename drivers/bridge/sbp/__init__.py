"""The sampling bridge protocol at the wire (SBP 1.0 and 1.1): encoders, decoders and the parser of the data stream.

All fields are little-endian, times are integer femtoseconds. Source: protocol sheet ``sampling_bridge.md``.
"""

from picoradar.drivers.bridge.sbp.codes import (
    EP_DATA,
    EP_EVENT,
    INTERFACE_CLASS,
    LASER_KEY,
    PRODUCT_ID,
    RESET_VALUE,
    VENDOR_ID,
    VERSION_1_0,
    VERSION_1_1,
    ConfigFlag,
    ErrorCode,
    EventKind,
    Feature,
    Format,
    Gate,
    Request,
    State,
    StatusFlag,
    error_name,
)
from picoradar.drivers.bridge.sbp.configuration import Configuration, WindowEntry, decode_windows, encode_windows
from picoradar.drivers.bridge.sbp.frames import Frame, FrameFlag, FrameParser, encode_frame
from picoradar.drivers.bridge.sbp.identity import Caps, Info
from picoradar.drivers.bridge.sbp.sealing import BadBlock, seal
from picoradar.drivers.bridge.sbp.status import ErrorEntry, Event, Status

__all__ = [
    "EP_DATA",
    "EP_EVENT",
    "INTERFACE_CLASS",
    "LASER_KEY",
    "PRODUCT_ID",
    "RESET_VALUE",
    "VENDOR_ID",
    "VERSION_1_0",
    "VERSION_1_1",
    "BadBlock",
    "Caps",
    "ConfigFlag",
    "Configuration",
    "ErrorCode",
    "ErrorEntry",
    "Event",
    "EventKind",
    "Feature",
    "Format",
    "Frame",
    "FrameFlag",
    "FrameParser",
    "Gate",
    "Info",
    "Request",
    "State",
    "Status",
    "StatusFlag",
    "WindowEntry",
    "decode_windows",
    "encode_frame",
    "encode_windows",
    "error_name",
    "seal",
]
