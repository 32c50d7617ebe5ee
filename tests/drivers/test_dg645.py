"""DG645: the worked exchange of the protocol sheet, both directions, and driver with firmware."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from picoradar.drivers.dg645 import DG645, Channel, Inhibit, InstrumentStatus, Output, TriggerSource
from picoradar.drivers.dg645.wire import Delay, decode, encode, format_number, parse_delay
from picoradar.drivers.errors import DeviceFault, LimitError, ProtocolError, Timeout
from picoradar.sim.firmware.dg645 import Dg645Firmware
from picoradar.sim.wires import InterlockChain, TriggerLine

IDN = b"Stanford Research Systems,DG645,s/n001013,ver1.02.0A\r\n"
CHECK = (b"LERR?\n", b"0\r\n")
GOLDEN = tomllib.loads((Path(__file__).parents[1] / "golden" / "dg645.toml").read_text())
SHEET = [(sent.encode(), "".join(replies).encode()) for sent, *replies in GOLDEN["exchange"]]


@pytest.fixture
def trigger():
    return TriggerLine()


@pytest.fixture
def interlock():
    return InterlockChain()


@pytest.fixture
def firmware(clock, trigger, interlock):
    return Dg645Firmware(clock, trigger, interlock)


@pytest.fixture
def generator(connect, firmware):
    device = DG645(connect(firmware))
    device.open()
    return device


def test_worked_exchange_of_the_sheet_by_the_firmware(firmware, played):
    for sent, reply in SHEET:
        assert played(firmware, sent) == reply


def test_worked_exchange_of_the_sheet_by_the_driver(scripted):
    generator = DG645(
        scripted(
            [
                (b"*IDN?\n", IDN),
                (b"TSRC 5\n", b""),
                CHECK,
                (b"TSRC?\n", b"5\r\n"),
                (b"TRAT 80000\n", b""),
                CHECK,
                (b"TRAT?\n", b"+80000.000000\r\n"),
                (b"DLAY 2,0,1e-7\n", b""),
                CHECK,
                (b"DLAY 3,2,1e-8\n", b""),
                CHECK,
                (b"DLAY?2\n", b"0,+0.000000100000\r\n"),
                (b"DLAY?3\n", b"2,+0.000000010000\r\n"),
                (b"LINK 3,0\n", b""),
                CHECK,
                (b"DLAY?3\n", b"0,+0.000000110000\r\n"),
                (b"DLAY 4,0,6.7e-12\n", b""),
                CHECK,
                (b"DLAY?4\n", b"0,+0.000000000005\r\n"),
                (b"DLAY 2,2,0\n", b""),
                (b"LERR?\n", b"13\r\n"),
                CHECK,
                (b"LAMP 1,3.3\n", b""),
                CHECK,
                (b"LAMP?1\n", b"+3.30\r\n"),
                (b"TSRC 0\n", b""),
                CHECK,
                (b"TSRC?\n", b"0\r\n"),
                (b"*RST\n", b""),
                (b"TSRC 5\n", b""),  # as the driver resets: the sheet's *RST, and the safe state by its own command
                CHECK,
                (b"TSRC?\n", b"5\r\n"),
                (b"DLAY?3\n", b"2,+0.000000010000\r\n"),
            ]
        )
    )
    assert str(generator.identify()) == "DG645, s/n 001013, ver1.02.0A"
    generator.stop_triggers()
    generator.trigger_rate_hz = 80e3
    assert generator.trigger_rate_hz == 80e3
    generator.set_delay(Channel.A, Channel.T0, 1e-7)
    generator.set_delay(Channel.B, Channel.A, 1e-8)
    assert generator.delay(Channel.A) == Delay(Channel.T0, 1e-7)
    assert generator.delay(Channel.B) == Delay(Channel.A, 1e-8)
    generator.link_channel(Channel.B, Channel.T0)
    assert generator.delay(Channel.B) == Delay(Channel.T0, 1.1e-7)
    generator.set_delay(Channel.C, Channel.T0, 6.7e-12)
    assert generator.delay(Channel.C) == Delay(Channel.T0, 5e-12)
    with pytest.raises(DeviceFault, match="illegal link") as refused:
        generator.set_delay(Channel.A, Channel.A, 0)
    assert refused.value.code == 13
    generator.output(Output.AB).amplitude_v = 3.3
    assert generator.output(Output.AB).amplitude_v == 3.3
    generator.start_triggers()
    generator.reset()
    assert generator.trigger_source is TriggerSource.SINGLE_SHOT
    assert generator.delay(Channel.B) == Delay(Channel.A, 1e-8)


def test_opening_sequence(scripted):
    link = scripted(
        [
            (b"\n", b""),
            (b"*IDN?\n", IDN),
            (b"*CLS\n", b""),
            (b"LERR?\n", b"111\r\n"),
            CHECK,
            (b"TSRC?\n", b"0\r\n"),  # an earlier program has left it firing
            (b"TSRC 5\n", b""),
            CHECK,
            (b"TSRC?\n", b"5\r\n"),
        ]
    )
    generator = DG645(link)
    generator.open()
    assert generator.found_on == ("triggers",)


def test_bytes_of_the_rate():
    assert encode("TRAT 80000") == bytes.fromhex("54 52 41 54 20 38 30 30 30 30 0a")


@pytest.mark.parametrize(
    ("value", "text"),
    [(80000.0, "80000"), (1e-7, "1e-7"), (6.7e-12, "6.7e-12"), (3.3, "3.3"), (0, "0"), (-1.5, "-1.5"), (1e16, "1e16")],
)
def test_numbers_are_short_and_exact(value, text):
    assert format_number(value) == text
    assert float(text) == value


@pytest.mark.parametrize(
    ("sent", "query", "reply"),
    [
        (b"DLAY 3,2,1.000000e-09\n", b"DLAY? 3\n", b"2,+0.000000001000\r\n"),
        (b"TRAT 80000.0\n", b"trat?\r\n", b"+80000.000000\r\n"),
        (b"\n", b"LERR?\n", b"0\r\n"),
    ],
)
def test_firmware_accepts_the_habits_of_clients(firmware, played, sent, query, reply):
    assert played(firmware, sent) == b""
    assert played(firmware, query) == reply


def test_another_device_is_refused(scripted):
    link = scripted([(b"\n", b""), (b"*IDN?\n", b"LAMBDA,GEN600-1.3\r\n")])
    with pytest.raises(ProtocolError, match="another device answers"):
        DG645(link).open()


@pytest.mark.parametrize(
    ("name", "value"),
    [("trigger_rate_hz", 1.1e7), ("trigger_rate_hz", float("nan")), ("burst_count", 0), ("trigger_level_v", -4)],
)
def test_nothing_is_sent_out_of_range(scripted, name, value):
    with pytest.raises(LimitError, match=r"is outside .*nothing was sent"):
        setattr(DG645(scripted([])), name, value)


def test_t0_has_no_delay_of_its_own(scripted):
    with pytest.raises(LimitError, match="T0"):
        DG645(scripted([])).set_delay(Channel.T0, Channel.T0, 1e-6)


def test_triggers_reach_the_wire_and_stop(generator, trigger):
    generator.trigger_rate_hz = 80e3
    generator.start_triggers()
    assert trigger.rate_hz == 80e3
    generator.close()
    assert trigger.rate_hz == 0


def test_open_interlock_inhibits_triggers(generator, trigger, interlock):
    generator.trigger_rate_hz = 80e3
    generator.start_triggers()
    interlock.closed = False
    assert trigger.rate_hz == 0
    assert generator.instrument_status() & InstrumentStatus.INHIBITED
    generator.inhibit = Inhibit.NOTHING
    assert trigger.rate_hz == 80e3


def test_busy_rule_divides_the_rate_and_sets_the_bit(generator, trigger):
    generator.trigger_rate_hz = 240e3
    generator.start_triggers()
    generator.set_delay(Channel.H, Channel.T0, 4.0e-6)
    generator.instrument_status()
    assert trigger.rate_hz == 240e3
    assert not generator.instrument_status() & InstrumentStatus.RATE
    generator.set_delay(Channel.H, Channel.T0, 4.2e-6)
    assert trigger.rate_hz == 120e3
    assert generator.instrument_status() & InstrumentStatus.RATE


def test_settings_survive_a_round_trip(generator):
    generator.burst = True
    generator.burst_count = 2**32 - 1
    generator.burst_period_s = 1e-6
    generator.inhibit = Inhibit.AB_CD
    generator.output(Output.EF).offset_v = -1.25
    generator.output(Output.GH).positive = False
    generator.set_step(Channel.D, 5e-12)
    generator.step(Channel.D, up=True)
    generator.step(Channel.D, up=True)
    generator.link_channel(Channel.D, Channel.A)
    generator.output(Output.AB).prescale = 8
    generator.output(Output.AB).phase = 3
    generator.save(4)
    generator.reset()
    assert generator.trigger_source is TriggerSource.SINGLE_SHOT
    assert not generator.burst
    generator.recall(4)
    assert (generator.burst, generator.burst_count, generator.burst_period_s) == (True, 2**32 - 1, 1e-6)
    assert generator.inhibit is Inhibit.AB_CD
    assert generator.output(Output.EF).offset_v == -1.25
    assert not generator.output(Output.GH).positive
    assert (generator.output(Output.AB).prescale, generator.output(Output.AB).phase) == (8, 3)
    assert generator.delay(Channel.D) == Delay(Channel.A, 10e-9 + 10e-12)
    assert generator.linked_to(Channel.D) is Channel.A
    assert generator.self_test() == 0


def test_empty_memory_is_a_fault(generator):
    with pytest.raises(DeviceFault, match="recall failed"):
        generator.recall(9)


@pytest.mark.parametrize(
    ("sent", "code"),
    [
        ("FOO 1", 111),
        ("TRAT", 116),
        ("TRAT 1,2", 115),
        ("TRAT x", 118),
        ("TSRC 1.5", 120),
        ("TSRC 7", 10),
        ("BURC 99999999999", 121),
        ("TIMB 1", 113),
        ("*TRG?", 112),
        ("DLAY 2,0,", 114),
        ("DLAY 2,0,-1e-9", 12),
        ("DLAY 2,0,2001", 12),
        ("DLAY 2,1,0", 13),
        ("TRAT 1" + "0" * 40, 117),
        ("?", 110),
    ],
)
def test_error_codes(generator, sent, code):
    with pytest.raises(DeviceFault) as refused:
        generator.configure(sent)
    assert refused.value.code == code


def test_links_in_a_ring_are_refused(generator):
    generator.set_delay(Channel.B, Channel.A, 1e-9)
    generator.set_delay(Channel.C, Channel.B, 1e-9)
    with pytest.raises(DeviceFault, match="illegal link"):
        generator.set_delay(Channel.A, Channel.C, 1e-9)
    assert generator.delay(Channel.A) == Delay(Channel.T0, 0.0)


def test_delay_may_be_negative_while_the_instant_is_not(generator):
    generator.set_delay(Channel.A, Channel.T0, 2e-9)
    generator.configure("DLAY 4,2,-2e-9")
    assert generator.delay(Channel.C) == Delay(Channel.A, -2e-9)
    with pytest.raises(DeviceFault, match="illegal delay"):
        generator.configure("DLAY 4,2,-2.005e-9")
    assert generator.delay(Channel.C) == Delay(Channel.A, -2e-9)


def test_error_queue_holds_twenty(generator):
    generator.link.write(b"FOO\n" * 25)
    assert generator.errors() == [111] * 19 + [254]


def test_late_reply_does_not_answer_the_next_question(scripted):
    link = scripted(
        [
            (b"TRAT?\n", b""),
            (b"\n*IDN?\n", b"+1000.000000\r\n" + IDN),
            CHECK,
            (b"TRAT?\n", b"+80000.000000\r\n"),
            (b"TSRC?\n", b"5\r\n"),
        ]
    )
    generator = DG645(link)
    assert generator.trigger_rate_hz == 80e3
    assert generator.trigger_source is TriggerSource.SINGLE_SHOT


def test_error_queue_is_asked_once(scripted):
    link = scripted([(b"TLVL 1\nLERR?\n", b"")])
    with pytest.raises(Timeout):
        DG645(link).trigger_level_v = 1.0


def test_stopping_is_tried_again_when_a_reply_is_lost(scripted):
    link = scripted(
        [
            (b"TSRC 5\nLERR?\n", b""),
            (b"\n*IDN?\n", IDN),
            CHECK,
            (b"TSRC 5\n", b""),
            CHECK,
            (b"TSRC?\n", b"5\r\n"),
        ]
    )
    DG645(link).stop_triggers()


def test_status_bits_and_masks(generator):
    generator.event_enable = 32
    generator.service_enable = 32
    generator.instrument_enable = 255
    assert (generator.event_enable, generator.service_enable, generator.instrument_enable) == (32, 32, 255)
    assert generator.status_byte() == 0
    with pytest.raises(DeviceFault):
        generator.configure("FOO")
    assert generator.status_byte() == 32 + 64
    assert generator.query("*STB? 5") == "1"
    assert generator.standard_events() == 32
    assert generator.status_byte() == 0
    generator.wait_complete()


def test_reply_end_can_be_changed(firmware, played):
    assert played(firmware, b"XTRM 10,0,0\n*OPC?\n") == b"1\n"


def test_one_bit_of_a_register_is_cleared_alone(generator):
    generator.trigger_rate_hz = 80e3
    generator.start_triggers()
    generator.link.clock.sleep(0.1)
    assert generator.query("INSR? 0") == "1"
    assert generator.query("INSR? 1") == "0"
    generator.stop_triggers()
    left = generator.instrument_status()
    assert InstrumentStatus.END_OF_DELAY in left
    assert generator.instrument_status() == InstrumentStatus(0)


def test_burst_prescale_and_hold_off_shape_the_rate(generator, trigger):
    generator.trigger_rate_hz = 1000
    generator.start_triggers()
    generator.burst_count = 10
    generator.burst_period_s = 1e-5
    generator.burst = True
    assert trigger.rate_hz == 10e3
    generator.burst = False
    generator.output(Output.T0).prescale = 4
    generator.output(Output.AB).prescale = 5
    assert trigger.rate_hz == 1000
    generator.advanced_triggering = True
    assert trigger.rate_hz == 50
    generator.output(Output.T0).prescale = 1
    generator.output(Output.AB).prescale = 1
    generator.hold_off_s = 2.5e-3
    assert trigger.rate_hz == pytest.approx(1000 / 3)


def test_change_of_delay_while_running_aborts_a_cycle(generator):
    generator.start_triggers()
    generator.set_delay(Channel.A, Channel.T0, 1e-7)
    assert InstrumentStatus.DELAY_ABORTED in generator.instrument_status()


def test_amplitude_and_offset_together_stay_below_6_v(generator):
    generator.output(Output.AB).amplitude_v = 5.0
    with pytest.raises(DeviceFault, match="illegal value"):
        generator.output(Output.AB).offset_v = 1.5
    generator.output(Output.AB).offset_v = 1.0


def test_replies_are_printable_text():
    assert decode(b"2,+0.000000010000\r\n") == "2,+0.000000010000"
    assert parse_delay(decode(b"3,-0.000000010000\r\n")) == Delay(Channel.B, -1e-8)
    for line in (b"5\x01\r\n", b"\xff\r\n"):
        with pytest.raises(ValueError, match=r"control characters|ascii"):
            decode(line)
