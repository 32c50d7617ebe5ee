"""Errors: of devices and links, and of files that cannot be decoded."""

from picoradar.drivers.errors.decoding import DECODER_ERRORS, decoder_words, parse_json, parse_toml, read_text
from picoradar.drivers.errors.device import (
    DeviceError,
    DeviceFault,
    LimitError,
    LinkLost,
    ProtocolError,
    Stall,
    Timeout,
    carry_out_all,
    check_range,
)

__all__ = [
    "DECODER_ERRORS",
    "DeviceError",
    "DeviceFault",
    "LimitError",
    "LinkLost",
    "ProtocolError",
    "Stall",
    "Timeout",
    "carry_out_all",
    "check_range",
    "decoder_words",
    "parse_json",
    "parse_toml",
    "read_text",
]
