"""The temperature controller Meerstetter TEC-1091, over MeCom."""

from picoradar.drivers.mecom.driver import Tec
from picoradar.drivers.mecom.parameters import (
    PARAMETERS,
    DeviceStatus,
    Kind,
    OutputEnable,
    OutputStageInput,
    Parameter,
    Stability,
)
from picoradar.drivers.mecom.wire import (
    ALL_ADDRESSES,
    ANY_ADDRESS,
    END,
    Frame,
    decode,
    decode_float,
    decode_int,
    encode,
    encode_float,
    encode_int,
)

__all__ = [
    "ALL_ADDRESSES",
    "ANY_ADDRESS",
    "END",
    "PARAMETERS",
    "DeviceStatus",
    "Frame",
    "Kind",
    "OutputEnable",
    "OutputStageInput",
    "Parameter",
    "Stability",
    "Tec",
    "decode",
    "decode_float",
    "decode_int",
    "encode",
    "encode_float",
    "encode_int",
]
