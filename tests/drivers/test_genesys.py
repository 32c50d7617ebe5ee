"""Genesys: the worked exchange and check sums of the protocol sheet, both directions, and driver with firmware."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from picoradar.drivers.errors import DeviceFault
from picoradar.drivers.genesys import Fault, Genesys, Status
from picoradar.drivers.genesys.wire import (
    Filter,
    Remote,
    SupplyState,
    checksum,
)
from picoradar.sim.firmware.genesys import GenesysFirmware
from picoradar.sim.taps import SerialTap
from picoradar.sim.wires import InterlockChain

GOLDEN = tomllib.loads((Path(__file__).parents[1] / "golden" / "genesys.toml").read_text())
SHEET = [(sent.encode(), reply.encode()) for sent, reply in GOLDEN["exchange"]]
AFTER_INTERLOCK_OPENED = [(sent.encode(), reply.encode()) for sent, reply in GOLDEN["after_interlock_opened"]]
AFTER_INTERLOCK_CLOSED = [(sent.encode(), reply.encode()) for sent, reply in GOLDEN["after_interlock_closed"]]


@pytest.fixture
def interlock():
    return InterlockChain()


@pytest.fixture
def firmware(clock, interlock):
    return GenesysFirmware(clock, interlock)


@pytest.fixture
def supply(connect, firmware):
    device = Genesys(connect(firmware))
    device.open()
    return device


def test_worked_exchange_of_the_sheet_by_the_firmware(firmware, interlock, played):
    for sent, reply in SHEET:
        assert played(firmware, sent) == reply
    interlock.closed = False
    for sent, reply in AFTER_INTERLOCK_OPENED:
        assert played(firmware, sent) == reply
    interlock.closed = True
    for sent, reply in AFTER_INTERLOCK_CLOSED:
        assert played(firmware, sent) == reply


def test_worked_exchange_of_the_sheet_by_the_driver(scripted):
    supply = Genesys(scripted(SHEET + AFTER_INTERLOCK_OPENED + AFTER_INTERLOCK_CLOSED))
    supply.command("ADR 6")
    assert supply.query("IDN?") == "LAMBDA,GEN600-1.3"
    supply.command("RMT 1")
    supply.auto_start = False
    supply.output = False
    supply.voltage_v = 240
    supply.overvoltage_v = 350
    assert supply.overvoltage_v == 350
    supply.current_a = 0.1
    supply.voltage_v = 290
    assert supply.voltage_v == 290
    assert supply.measured_v == 0
    assert supply.state() == SupplyState(0.0, 290.0, 0.0, 0.1, Status.NO_FAULT, Fault(0))
    with pytest.raises(DeviceFault, match="voltage above the range") as refused:
        supply.voltage_v = 340
    assert refused.value.code == "E01"
    supply.output = True
    assert supply.measured_v == 290.01
    assert supply.status == Status.CONSTANT_VOLTAGE | Status.NO_FAULT
    assert supply.fault == Fault(0)
    assert supply.fault is Fault.INTERLOCK
    assert supply.status is Status.NO_FAULT  # for FENA is 00
    assert not supply.output
    with pytest.raises(DeviceFault) as refused:
        supply.output = True
    assert refused.value.code == "E07"
    assert supply.fault == Fault(0)
    assert not supply.output
    supply.output = True


def test_firmware_answers_a_check_sum_with_a_check_sum(firmware, played):
    assert played(firmware, b"ADR 6$2D\r") == b"OK$9A\r"
    assert played(firmware, b"OUT 1$48\r") == b"C04$A7\r"
    assert played(firmware, b"OUT?$" + checksum("OUT?").encode() + b"\r") == b"OFF$DB\r"


@pytest.mark.parametrize("with_checksum", [False, True])
def test_driver_with_firmware(connect, firmware, with_checksum):
    supply = Genesys(connect(firmware), checksum=with_checksum)
    supply.open()
    supply.protect(overvoltage_v=350, undervoltage_v=0, current_a=0.1)
    supply.voltage_v = 290
    supply.switch(on=True)
    assert supply.mode == "CV"
    supply.link.clock.sleep(1.0)
    state = supply.state()
    assert (state.voltage_v, state.measured_v, state.current_a) == (290, 290.01, 0.1)
    assert state.measured_a == 0.0124
    assert state.status == Status.CONSTANT_VOLTAGE | Status.NO_FAULT
    assert supply.query("DVC?") == "290.01,290.00,0.0124,0.1000,350.0,000.0"
    assert str(supply.identify()) == "GEN600-1.3, s/n 0123456, 1U-4.3"
    supply.close()
    assert firmware.output_v() > 60


def test_output_starts_softly_and_discharges(supply, firmware, clock):
    supply.voltage_v = 290
    supply.current_a = 0.1
    supply.switch(on=True)
    assert 0 < firmware.output_v() < 290
    clock.sleep(0.2)
    assert firmware.output_v() == 290
    supply.switch(on=False)
    assert 60 < firmware.output_v() < 290
    clock.sleep(1.0)
    assert firmware.output_v() < 60


def test_open_interlock_switches_off_and_stays_off(supply, firmware, interlock):
    supply.voltage_v = 290
    supply.current_a = 0.1
    supply.switch(on=True)
    interlock.closed = False
    assert supply.fault is Fault.INTERLOCK
    assert not supply.status & (Status.CONSTANT_VOLTAGE | Status.CONSTANT_CURRENT)
    with pytest.raises(DeviceFault, match="while a fault shuts it down"):
        supply.switch(on=True)
    interlock.closed = True
    assert not supply.output
    assert supply.fault == Fault(0)
    supply.switch(on=True)
    assert supply.output


@pytest.mark.parametrize(
    ("sent", "reply"),
    [
        ("PV", "C02"),
        ("PV x", "C03"),
        ("PV 1234567890123", "C03"),
        ("PV 631", "E01"),
        ("FOO 1", "C01"),
        ("FOO?", "C01"),
        ("OUT 2", "C03"),
        ("OVP 700", "C05"),
        ("PC 2", "C05"),
        ("UVL 10", "E06"),
        ("FILTER 20", "C03"),
        ("FENA 1", "C03"),
        ("CLS 1", "C03"),
        ("out 0", "OK"),
        ("", "OK"),
    ],
)
def test_replies_to_bad_messages(firmware, played, sent, reply):
    assert played(firmware, b"ADR 6\r") == b"OK\r"
    assert played(firmware, sent.encode() + b"\r") == reply.encode() + b"\r"


def test_cross_rules(supply):
    supply.overvoltage_v = 346.5
    supply.voltage_v = 329.175
    with pytest.raises(DeviceFault, match="E01"):
        supply.voltage_v = 330
    with pytest.raises(DeviceFault, match="E04"):
        supply.overvoltage_v = 345
    with pytest.raises(DeviceFault, match="E06"):
        supply.undervoltage_v = 330
    supply.undervoltage_v = 329.175  # equal is allowed
    with pytest.raises(DeviceFault, match="E02"):
        supply.voltage_v = 329


def test_limits_are_set_in_an_order_that_the_supply_takes(supply):
    supply.voltage_v = 330
    supply.protect(overvoltage_v=300, undervoltage_v=228, current_a=0.1)
    assert (supply.overvoltage_v, supply.undervoltage_v, supply.voltage_v) == (300, 228, 240)


def test_unit_that_is_not_chosen_stays_silent(firmware, played):
    assert played(firmware, b"OUT?\r") == b""
    assert played(firmware, b"ADR 6\r") == b"OK\r"
    assert played(firmware, b"OUT?\r") == b"OFF\r"
    assert played(firmware, b"ADR 7\r") == b""
    assert played(firmware, b"OUT?\r") == b""


def test_backspace_line_feed_and_repetition(firmware, played):
    assert played(firmware, b"ADR 6\rPV 28\x08\x0890\r\n") == b"OK\rOK\r"
    assert played(firmware, b"PV?\r") == b"90\r"
    assert played(firmware, b"\\\r") == b"90\r"


def test_unsolicited_messages_are_sorted_from_replies(supply, interlock):
    supply.enable_events(Fault.INTERLOCK, Status.FAULT)
    supply.link.write(b"OUT?\r")
    interlock.closed = False
    assert supply.link.read_until(b"\r") == b"!06\r"
    assert supply.link.read_until(b"\r") == b"OFF\r"
    interlock.closed = True
    assert supply.fault_events() is Fault.INTERLOCK
    interlock.closed = False
    assert not supply.output
    assert supply.unsolicited == 0  # nothing more is sent until SEVE is cleared
    assert supply.status_events() is Status.FAULT
    assert supply.fault_events() is Fault.INTERLOCK
    assert supply.fault_events() == Fault(0)
    interlock.closed = True
    interlock.closed = False
    assert not supply.output
    assert supply.unsolicited == 1


@pytest.mark.parametrize(
    ("fault_mask", "opened", "events_read", "closed", "closed_and_read"),
    [("00", "04", "04", "04", "04"), ("80", "08", "00", "0C", "04")],
)
def test_status_follows_the_masked_faults_and_their_events(
    supply, interlock, fault_mask, opened, events_read, closed, closed_and_read
):
    """The sheet's table of states; whether the event comes again while the fault lasts is left open there."""
    supply.command(f"FENA {fault_mask}")
    assert supply.query("STAT?") == "04"
    interlock.closed = False
    assert (supply.query("FLT?"), supply.query("STAT?")) == ("80", opened)
    assert (supply.query("FEVE?"), supply.query("STAT?")) == (fault_mask, events_read)
    interlock.closed = True
    interlock.closed = False
    interlock.closed = True
    assert (supply.query("FLT?"), supply.query("STAT?")) == ("00", closed)
    assert (supply.query("FEVE?"), supply.query("STAT?")) == (fault_mask, closed_and_read)


def test_set_points_and_limits_are_given_back_as_the_text_that_was_sent(supply):
    for text in ("PV 012.0", "PC 0.10", "OVP 0350", "UVL 5.00"):
        supply.command(text)
    assert [supply.query(f"{key}?") for key in ("PV", "PC", "OVP", "UVL")] == ["012.0", "0.10", "0350", "5.00"]
    supply.highest_overvoltage()
    assert supply.query("OVP?") == "660.0"
    supply.reset()
    assert [supply.query(f"{key}?") for key in ("PV", "PC", "OVP", "UVL")] == ["000.00", "0.0000", "660.0", "000.0"]


def test_foldback_shuts_the_output_down(supply, clock):
    supply.voltage_v = 290
    supply.current_a = 0.005
    supply.foldback_delay = 5
    supply.switch(on=True)
    clock.sleep(2)
    assert supply.mode == "CC"
    supply.foldback = True
    clock.sleep(0.6)
    assert supply.output
    clock.sleep(0.2)
    assert not supply.output
    assert supply.fault is Fault.FOLDBACK
    supply.current_a = 0.1
    supply.switch(on=True)
    assert supply.fault == Fault(0)


def test_a_late_answer_to_the_line_end_that_opens_shifts_nothing(connect, firmware):
    tap = SerialTap(firmware)
    late_s: list[float] = []

    def delayed(data, delay_s):
        return [(data, delay_s + (late_s.pop() if late_s else 0.0))]

    tap.to_host.append(delayed)
    supply = Genesys(connect(tap))
    supply.open()
    supply.close()
    late_s.append(0.2)  # a unit that is still selected answers the line end too, here after the driver's quiet time
    supply.open()
    assert not late_s
    assert (supply.rated_v, supply.output) == (600.0, False)
    assert supply.identify().serial_number == "0123456"


@pytest.mark.parametrize("fault", [Fault.AC_FAIL, Fault.OVER_TEMPERATURE, Fault.SHUT_OFF])
def test_faults_switch_off_and_are_told(supply, firmware, fault):
    supply.enable_events(Fault(0xFE), Status.FAULT)
    supply.voltage_v = 290
    supply.current_a = 0.1
    supply.switch(on=True)
    firmware.supply.fail(fault)
    assert not supply.output
    assert supply.fault is fault
    assert Status.FAULT in supply.status
    assert supply.unsolicited == 1
    assert (supply.fault_events(), supply.status_events()) == (fault, Status.FAULT)
    with pytest.raises(DeviceFault, match="E07"):
        supply.switch(on=True)
    firmware.supply.fail(Fault(0))
    supply.switch(on=True)


@pytest.mark.parametrize("fault", [Fault.OVER_VOLTAGE, Fault.PANEL_OFF])
def test_trips_that_switching_on_clears(supply, firmware, fault):
    supply.switch(on=True)
    firmware.supply.fail(fault)
    assert not supply.output
    supply.switch(on=False)
    assert supply.fault is fault
    supply.switch(on=True)
    assert supply.fault == Fault(0)


def test_saving_recalling_and_resetting(supply):
    supply.overvoltage_v = 350
    supply.voltage_v = 290
    supply.current_a = 0.1
    supply.filter_hz = Filter.HZ_46
    supply.save()
    supply.reset()
    assert (supply.overvoltage_v, supply.voltage_v, supply.current_a) == (660, 0, 0)
    supply.recall()
    assert (supply.overvoltage_v, supply.voltage_v, supply.current_a) == (350, 290, 0.1)
    supply.highest_overvoltage()
    supply.foldback_delay = 20
    supply.reset_foldback_delay()
    supply.clear_events()
    assert (supply.overvoltage_v, supply.foldback_delay, supply.filter_hz) == (660, 0, Filter.HZ_46)


def test_who_may_operate_it(supply):
    assert supply.remote is Remote.REM
    supply.remote = Remote.LOC
    assert Status.LOCAL in supply.status
    supply.voltage_v = 10.0  # a setting takes it back
    assert supply.remote is Remote.REM
    supply.remote = Remote.LLO
    assert supply.remote is Remote.LLO


def test_auto_start_brings_the_output_back(supply, interlock):
    supply.current_a = 0.1
    supply.auto_start = True
    supply.switch(on=True)
    interlock.closed = False
    assert not supply.output
    interlock.closed = True
    assert supply.output
