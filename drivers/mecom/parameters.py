"""The parameters of Meerstetter TEC-1089 / 1091 that this bench uses (protocol sheet ``mecom_tec``).

One row per parameter; driver and simulated firmware use the same table, which stands for the manufacturer's document.
Where the sheet gives no limits they are those of the type.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

PINS = 8
_INT = (-(2.0**31), 2.0**31 - 1)
_FLOAT = (-3.4e38, 3.4e38)


class Kind(Enum):
    """How a value is written: INT32 or FLOAT32, eight hex digits each."""

    INT = 1
    FLOAT = 0


class DeviceStatus(IntEnum):
    """Parameter 104."""

    INIT = 0
    READY = 1
    RUN = 2
    ERROR = 3
    BOOT_LOADER = 4
    ABOUT_TO_RESET = 5


class Stability(IntEnum):
    """Parameter 1200."""

    NOT_REGULATING = 0
    NOT_STABLE = 1
    STABLE = 2


class OutputStageInput(IntEnum):
    """Parameter 2000."""

    STATIC = 0
    LIVE = 1
    TEMPERATURE_CONTROLLER = 2


class OutputEnable(IntEnum):
    """Parameter 2010."""

    OFF = 0
    ON = 1
    LIVE = 2
    HARDWARE_PIN = 3


@dataclass(frozen=True)
class Parameter:
    """One row: id, name, kind, whether it can be set, limits, and whether it belongs to the whole device.

    ``instances`` counts the pins of a parameter that each pin has for its own; else it is 1.
    """

    number: int
    name: str
    kind: Kind
    writable: bool
    minimum: float
    maximum: float
    common: bool
    instances: int = 1


def _int(number: int, name: str, *, rw: bool = False, span: tuple[float, float] = _INT) -> Parameter:
    return Parameter(number, name, Kind.INT, rw, *span, common=number < 1000 or number in (2050, 2051, 2052, 2060))


def _float(number: int, name: str, *, rw: bool = False, span: tuple[float, float] = _FLOAT) -> Parameter:
    return Parameter(number, name, Kind.FLOAT, rw, *span, common=number == 2060)


def _pin(number: int, name: str, *, span: tuple[float, float] = _INT) -> Parameter:
    return Parameter(number, name, Kind.INT, True, *span, common=True, instances=PINS)


PARAMETERS: dict[int, Parameter] = {
    row.number: row
    for row in (
        _int(100, "device type"),
        _int(101, "hardware version"),
        _int(102, "serial number"),
        _int(103, "firmware version"),
        _int(104, "device status"),
        _int(105, "error number"),
        _int(106, "error instance"),
        _int(107, "error parameter"),
        _int(108, "saving to flash", rw=True, span=(0, 1)),
        _int(109, "flash state"),
        _float(1000, "object temperature"),
        _float(1001, "sink temperature"),
        _float(1010, "target temperature"),
        _float(1011, "nominal temperature of the ramp"),
        _float(1012, "thermal power model current"),
        _float(1020, "output current"),
        _float(1021, "output voltage"),
        _float(1032, "PID control variable"),
        _float(1063, "device temperature"),
        _int(1200, "temperature is stable"),
        _int(2000, "output stage input", rw=True, span=(0, 2)),
        _int(2010, "output enable", rw=True, span=(0, 3)),
        _float(2020, "static current", rw=True, span=(-4, 4)),
        _float(2021, "static voltage", rw=True, span=(-21, 21)),
        _float(2030, "current limit", rw=True, span=(0, 4)),
        _float(2031, "voltage limit", rw=True, span=(0, 21)),
        _float(2032, "current error threshold", rw=True, span=(0, 5.6)),
        _float(2033, "voltage error threshold", rw=True, span=(0, 25)),
        _int(2040, "general operating mode", rw=True, span=(0, 2)),
        _int(2050, "baud rate", rw=True, span=(4800, 1_000_000)),
        _int(2051, "address", rw=True, span=(1, 254)),
        _int(2052, "reply delay", rw=True, span=(0, 1_000_000)),
        _float(2060, "communication watchdog", rw=True, span=(0, 600)),
        _float(3000, "target object temperature", rw=True, span=(-273.15, 1000)),
        _float(3002, "proximity width", rw=True, span=(0, 1000)),
        _float(3003, "ramp", rw=True, span=(0, 1000)),
        _float(3010, "Kp", rw=True, span=(0, 3.4e38)),
        _float(3011, "Ti", rw=True, span=(0, 3.4e38)),
        _float(3012, "Td", rw=True, span=(0, 3.4e38)),
        _float(3013, "damping of the D part", rw=True, span=(0, 3.4e38)),
        _int(3020, "thermal regulation mode", rw=True, span=(0, 2)),
        _int(3034, "positive current is", rw=True, span=(0, 1)),
        _float(4010, "lower object error threshold", rw=True),
        _float(4011, "upper object error threshold", rw=True),
        _float(4012, "largest temperature change", rw=True, span=(0, 3.4e38)),
        _int(4034, "object sensor type"),
        _float(4040, "stable deviation", rw=True, span=(0, 1000)),
        _float(4041, "minimum stable time", rw=True, span=(0, 100_000)),
        _float(4042, "longest time until stable", rw=True, span=(0, 100_000)),
        _pin(6100, "pin: function"),
        _pin(6101, "pin: level assignment", span=(0, 1)),
        _pin(6102, "pin: hardware configuration"),
        _pin(6103, "pin: channel", span=(1, 2)),
        _int(6300, "object temperature: source selection", rw=True),
        _int(6302, "object temperature: observe mode", rw=True),
        _float(6310, "delay till restart after an error", rw=True, span=(0, 3.4e38)),
        _int(50000, "live enable", rw=True, span=(0, 1)),
        _int(52000, "look-up table: start", rw=True, span=(0, 1)),
        _int(52001, "look-up table: stop", rw=True, span=(0, 1)),
        _int(52002, "look-up table: state"),
        _int(52003, "look-up table: present line"),
        _int(52010, "look-up table: table number", rw=True),
        _int(52012, "look-up table: repetitions", rw=True, span=(0, 100_000)),
        _int(52100, "pins by bus: enable", rw=True, span=(0, 255)),
        _int(52101, "pins by bus: push-pull", rw=True, span=(0, 255)),
        _int(52102, "pins by bus: output states", rw=True, span=(0, 255)),
        _int(52103, "pins by bus: input states"),
        _float(52200, "external object temperature", rw=True),
    )
}
