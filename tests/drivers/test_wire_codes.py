"""The code tables of the protocol sheets, value by value: a wrong bit here is a fault that is read as another one."""

from __future__ import annotations

from enum import IntEnum

import pytest

from picoradar.drivers.bridge.sbp.frames import FrameFlag as BridgeFlag
from picoradar.drivers.dg645 import wire as dg645
from picoradar.drivers.genesys import wire as genesys
from picoradar.drivers.helios import wire as helios
from picoradar.drivers.links import usbtmc_wire as usbtmc
from picoradar.drivers.mecom import parameters as tec
from picoradar.drivers.mecom import wire as mecom

BITS = (1, 2, 4, 8, 16, 32, 64, 128)


def counted(first: int, *names: str) -> dict[str, int]:
    return {name: first + k for k, name in enumerate(names)}


def bits(*names: str | None) -> dict[str, int]:
    return {name: bit for name, bit in zip(names, BITS, strict=False) if name}


CODES: dict[type[IntEnum] | type, dict[str, int]] = {
    dg645.TriggerSource: counted(
        0, "INTERNAL", "EXTERNAL_RISING", "EXTERNAL_FALLING", "SINGLE_EXTERNAL_RISING", "SINGLE_EXTERNAL_FALLING",
        "SINGLE_SHOT", "LINE",
    ),
    dg645.Channel: counted(0, "T0", "T1", *"ABCDEFGH"),
    dg645.Output: counted(0, "T0", "AB", "CD", "EF", "GH"),
    dg645.Inhibit: counted(0, "NOTHING", "TRIGGERS", "AB", "AB_CD", "AB_CD_EF", "ALL"),
    dg645.TimeBase: counted(0, "INTERNAL", "OCXO", "RUBIDIUM", "EXTERNAL"),
    dg645.InstrumentStatus: bits(
        "TRIGGERED", "RATE", "END_OF_DELAY", "END_OF_BURST", "INHIBITED", "DELAY_ABORTED", "PLL_UNLOCKED",
        "RUBIDIUM_UNLOCKED",
    ),
    genesys.Fault: bits(
        None, "AC_FAIL", "OVER_TEMPERATURE", "FOLDBACK", "OVER_VOLTAGE", "SHUT_OFF", "PANEL_OFF", "INTERLOCK"
    ),
    genesys.Status: bits(
        "CONSTANT_VOLTAGE", "CONSTANT_CURRENT", "NO_FAULT", "FAULT", "AUTO_START", "FOLDBACK_ENABLED", None, "LOCAL"
    ),
    genesys.Filter: {"HZ_18": 18, "HZ_23": 23, "HZ_46": 46},
    genesys.Remote: counted(0, "LOC", "REM", "LLO"),
    tec.DeviceStatus: counted(0, "INIT", "READY", "RUN", "ERROR", "BOOT_LOADER", "ABOUT_TO_RESET"),
    tec.Stability: counted(0, "NOT_REGULATING", "NOT_STABLE", "STABLE"),
    tec.OutputStageInput: counted(0, "STATIC", "LIVE", "TEMPERATURE_CONTROLLER"),
    tec.OutputEnable: counted(0, "OFF", "ON", "LIVE", "HARDWARE_PIN"),
    helios.Command: counted(1, "STOP", "SHUTTER", "STATUS", "FIRMWARE", "NAME", "SET_NAME", "SDK_VERSION"),
    helios.Answer: counted(0x83, "STATUS", "FIRMWARE", "NAME"),
    helios.FrameFlag: bits("START_AT_ONCE", "PLAY_ONCE", "DO_NOT_BLOCK"),
    BridgeFlag: bits("FIRST", "LAST", "CLIPPED", "LOST_BEFORE", "TRIGGER_LOST", "END_OF_RUN", "TEST_PATTERN"),
    usbtmc.MsgId: {
        "DEV_DEP_MSG_OUT": 1, "DEV_DEP_MSG_IN": 2, "VENDOR_OUT": 126, "VENDOR_IN": 127, "TRIGGER": 128,
    },
    usbtmc.ControlRequest: {
        **counted(
            1, "INITIATE_ABORT_BULK_OUT", "CHECK_ABORT_BULK_OUT_STATUS", "INITIATE_ABORT_BULK_IN",
            "CHECK_ABORT_BULK_IN_STATUS", "INITIATE_CLEAR", "CHECK_CLEAR_STATUS", "GET_CAPABILITIES",
        ),
        "INDICATOR_PULSE": 64,
        "READ_STATUS_BYTE": 128,
        **counted(160, "REN_CONTROL", "GO_TO_LOCAL", "LOCAL_LOCKOUT"),
    },
    usbtmc.TmcStatus: {
        "SUCCESS": 1, "PENDING": 2, "INTERRUPT_IN_BUSY": 0x20,
        **counted(0x80, "FAILED", "TRANSFER_NOT_IN_PROGRESS", "SPLIT_NOT_IN_PROGRESS", "SPLIT_IN_PROGRESS"),
    },
}  # fmt: skip

DG645_ERRORS = """
0 no error; 10 illegal value; 11 illegal mode; 12 illegal delay; 13 illegal link; 14 recall failed; 15 not allowed;
16 self test; 17 calibration; 30 lost data; 32 no listener; 40 ROM; 41 offset of T0; 42 offset of AB; 43 offset of CD;
44 offset of EF; 45 offset of GH; 46 amplitude of T0; 47 amplitude of AB; 48 amplitude of CD; 49 amplitude of EF;
50 amplitude of GH; 51 FPGA; 52 GPIB; 53 DDS; 54 EEPROM; 55 temperature; 56 PLL; 57 DAC 0; 58 DAC 1; 59 DAC 2;
60 sample and hold; 61 Vjitter; 62 delay of T0; 63 delay of T1; 64 delay of A; 71 delay of H; 80 sample and hold;
81 calibration of T0; 82 calibration of T1; 83 calibration of A; 90 calibration of H; 91 Vjitter;
110 illegal command; 111 undefined command; 112 illegal query; 113 illegal set; 114 empty parameter;
115 too many parameters; 116 too few parameters; 117 parameter too long; 118 bad float; 120 bad integer;
121 integer overflow; 122 hexadecimal; 126 syntax; 170 communication; 171 overrun; 254 queue overflow"""
GENESYS_ERRORS = """
E01 above the range; E02 below the under-voltage limit; E04 over-voltage trip too low; E06 limit above the voltage;
E07 while a fault shuts it down; C01 illegal command; C02 parameter missing; C03 illegal parameter; C04 check sum;
C05 out of range"""
MECOM_REFUSALS = """
1 command not available; 2 busy; 3 communication; 4 format; 5 parameter not available; 6 read only; 7 out of range;
8 instance; 9 general failure"""
MECOM_ERRORS = """
11 emergency stop; 22 corrupt; 23 incompatible; 30 supply voltage low; 31 supply voltage high; 32 medium supply low;
33 medium supply high; 36 3.3 V supply low; 37 3.3 V supply high; 60 hot; 100 over-current; 101 over-current;
102 over-current; 103 over-current; 104 over-voltage; 105 over-voltage; 106 residual; 107 total; 108 saturation;
137 below threshold; 138 above threshold; 139 too fast; 140 sink; 141 sink; 142 sink; 143 sink; 144 sink;
170 tuning; 171 tuning; 172 tuning; 173 tuning; 175 fan; 176 fan; 182 not stable in time; 183 watchdog"""


@pytest.mark.parametrize("kind", CODES, ids=lambda kind: f"{kind.__module__.split('.')[-2]}.{kind.__name__}")
def test_every_code_is_that_of_the_sheet(kind: type[IntEnum]) -> None:
    assert {member.name: member.value for member in kind} == CODES[kind]


@pytest.mark.parametrize(
    ("text", "table"),
    [
        (DG645_ERRORS, dg645.ERRORS),
        (GENESYS_ERRORS, genesys.ERRORS),
        (MECOM_REFUSALS, mecom.REFUSALS),
        (MECOM_ERRORS, mecom.ERRORS),
    ],
    ids=["dg645", "genesys", "mecom refusals", "mecom"],
)
def test_every_error_has_its_meaning(text: str, table: dict[object, str]) -> None:
    known = {str(code): meaning for code, meaning in table.items()}
    said = dict(entry.split(maxsplit=1) for entry in " ".join(text.split()).split("; "))
    assert {code for code, meaning in said.items() if meaning not in known.get(code, "")} == set()
    left_out = {str(code) for code in (*range(65, 71), *range(84, 90))} if table is dg645.ERRORS else set()
    assert set(known) - set(said) == left_out  # the delays of B to G, told by those of A and H


def test_addresses_and_sizes() -> None:
    assert (mecom.ANY_ADDRESS, mecom.ALL_ADDRESSES) == (0x00, 0xFF)
    assert dg645.QUEUE_LENGTH == 20
    assert (helios.VENDOR_ID, helios.PRODUCT_ID) == (0x1209, 0xE500)
    assert (helios.EP_FRAME, helios.EP_COMMAND, helios.EP_ANSWER) == (0x02, 0x06, 0x83)
    assert (helios.ANSWER_SIZE, helios.CODES, helios.CENTRE, helios.SDK_VERSION) == (32, 4096, 2048, 11)
    assert (helios.RATE_MIN_HZ, helios.RATE_MAX_HZ, helios.POINTS_MAX, helios.NAME_MAX) == (7, 65535, 4095, 20)
    assert usbtmc.INTERFACE_CLASS == (0xFE, 0x03, 0x01)
    assert (usbtmc.HEADER, usbtmc.CLASS_TO_INTERFACE, usbtmc.CLASS_TO_ENDPOINT) == (12, 0xA1, 0xA2)
