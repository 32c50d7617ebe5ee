"""TC200: the worked exchange of the protocol sheet, both directions, and driver with firmware."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import pytest

from picoradar.drivers.errors import DeviceFault, LimitError, ProtocolError, Timeout
from picoradar.drivers.interfaces import TemperatureController
from picoradar.drivers.tc200.driver import TC200
from picoradar.drivers.tc200.wire import Mode, Sensor, Status, read_gains, read_temperature, split_answer
from picoradar.sim.firmware.tc200.device import Tc200Firmware

GOLDEN = tomllib.loads((Path(__file__).parents[1] / "golden" / "tc200.toml").read_text())
((sent, reply),) = GOLDEN["exchange"]
TACT = (sent.encode(), reply.encode())


class Block:
    """A block with a leak to 21 degC."""

    def __init__(self, clock):
        self.clock = clock
        self.degc = 21.0
        self.current_a = 0.0
        self._since = 0.0

    def temperature_degc(self):
        elapsed, self._since = self.clock.now() - self._since, self.clock.now()
        settled = 21.0 + 10.0 * self.current_a**2
        self.degc = settled + (self.degc - settled) * math.exp(-elapsed / 60.0)
        return self.degc

    def sink_degc(self):
        return 21.0

    def drive(self, current_a):
        self.temperature_degc()
        self.current_a = current_a


@pytest.fixture
def block(clock):
    return Block(clock)


@pytest.fixture
def heater(connect, clock, block):
    device = TC200(connect(Tc200Firmware(clock, block)))
    device.open()
    return device


def test_bytes_of_the_sheet():
    assert TACT[0] + TACT[1][6:] == bytes.fromhex("74 61 63 74 3f 0d 33 30 20 43 0d 3e 20")


def test_worked_exchange_of_the_sheet_by_the_driver(scripted):
    assert TC200(scripted([TACT])).temperature_degc == 30.0


def test_worked_exchange_of_the_sheet_by_the_firmware(clock, block, played):
    block.temperature_degc = lambda: 30.0
    assert played(Tc200Firmware(clock, block), TACT[0]) == TACT[1].replace(b"30 C", b"30.0 C")


@pytest.mark.parametrize(
    ("sent", "reply"),
    [
        (b"stat?\r", b"stat?\r60 > "),
        (b"ens\r", b"ens\r> "),
        (b"tset=40.0\r", b"tset=40.0\r> "),
        (b"tset?\r", b"tset?\r25.0 C\r> "),
        (b"pid?\r", b"pid?\r125 50 0\r> "),
        (b"mode=normal\r", b"mode=normal\rCommand error CMD_ARG_RANGE_ERR\n\r> "),
        (b"tset=300\r", b"tset=300\rCommand error CMD_ARG_RANGE_ERR\n\r> "),
        (b"foo?\r", b"foo?\rCommand error CMD_NOT_DEFINED\n\r> "),
        (b"\r", b"\r> "),
    ],
)
def test_firmware_echoes_answers_and_prompts(clock, block, played, sent, reply):
    assert played(Tc200Firmware(clock, block), sent) == reply


@pytest.mark.parametrize(
    ("received", "echo", "answer"),
    [
        (b"stat?\r54 > ", "stat?", "54"),
        (b"tact?\r30 Celsius\r> ", "tact?", "30 Celsius"),
        (b"ens\r> ", "ens", ""),
    ],
)
def test_echo_and_answer(received, echo, answer):
    assert split_answer(received) == (echo, answer)


def test_answers_of_the_sheet():
    assert read_temperature("30 C") == read_temperature("30 Celsius") == read_temperature("30.0") == 30.0
    assert read_gains("2 0 220") == (2, 0, 220)
    with pytest.raises(ValueError, match="no temperature in degC"):
        read_temperature("86 F")


def test_enable_is_a_toggle_and_read_first(scripted):
    link = scripted(
        [
            (b"stat?\r", b"stat?\r48 > "),
            (b"ens\r", b"ens\r> "),
            (b"stat?\r", b"stat?\r49 > "),
            (b"stat?\r", b"stat?\r48 > "),
            (b"stat?\r", b"stat?\r48 > "),
        ]
    )
    heater = TC200(link)
    heater._switch(on=True)
    heater.off()


def test_heats_to_its_target_and_goes_off(heater, clock, block):
    controller: TemperatureController = heater
    controller.regulate(30.0)
    assert controller.status().regulating
    assert not controller.status().stable
    clock.sleep(300)
    assert controller.status().stable
    controller.close()
    assert block.current_a == 0
    assert clock.next_due() is None


def test_settings_survive_a_round_trip(heater):
    heater.gains = (2, 0, 220)
    heater.largest_power_w = 12.0
    heater.largest_degc = 80.0
    heater.beta = 5600
    heater.select_sensor(Sensor.TH10K)
    heater.mode = Mode.CYCLE
    assert heater.mode is Mode.CYCLE
    heater.mode = Mode.NORMAL
    assert heater.mode is Mode.NORMAL
    assert (heater.gains, heater.largest_power_w, heater.largest_degc, heater.beta) == ((2, 0, 220), 12.0, 80.0, 5600)
    assert Status.CYCLE not in heater.status_bits
    with pytest.raises(LimitError, match="target 81 degC is outside 20 to 80 degC"):
        heater.target_degc = 81.0


def test_refusal_is_a_fault(heater):
    with pytest.raises(DeviceFault, match="refused beta=1: CMD_ARG_RANGE_ERR"):
        heater.command("beta=1")


def test_late_answer_is_dropped_by_its_echo(scripted):
    link = scripted([(b"tset=40.0\r", b""), (b"tact?\r", b"tset=40.0\r> tact?\r30 C\r> ")])
    heater = TC200(link)
    with pytest.raises(Timeout):
        heater.command("tset=40.0")
    assert heater.temperature_degc == 30.0


def test_another_device_is_refused(scripted):
    link = scripted([(b"\r", b"\r> "), (b"*idn?\r", b"*idn?\rsomething else\r> ")])
    with pytest.raises(ProtocolError, match="another device answers"):
        TC200(link).open()
