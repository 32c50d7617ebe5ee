"""MeCom: every telegram of the protocol sheet, both directions, and driver with firmware."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import pytest

from picoradar.drivers.errors import DeviceFault, LimitError, LinkLost, ProtocolError, Timeout
from picoradar.drivers.mecom import (
    DeviceStatus,
    Kind,
    OutputEnable,
    OutputStageInput,
    Stability,
    Tec,
    decode,
    decode_float,
    decode_int,
    encode,
    encode_float,
    encode_int,
)
from picoradar.drivers.mecom.session import MeCom
from picoradar.drivers.mecom.wire import crc16
from picoradar.sim.firmware.mecom import TecFirmware
from picoradar.sim.ports.wire import wire_at

GOLDEN = tomllib.loads((Path(__file__).parents[1] / "golden" / "mecom.toml").read_text())
PRINTED = [(sent.encode(), reply.encode()) for sent, reply in GOLDEN["printed"]]
COMPUTED = [(sent.encode(), reply.encode()) for sent, reply in GOLDEN["computed"]]
LONE = [telegram.encode() for (telegram,) in GOLDEN["alone"]]


class Block:
    """A diode block that warms and cools at a fixed rate per ampere, with a leak to 21 degC."""

    def __init__(self, clock, temperature_degc=21.0):
        self.clock = clock
        self.degc = temperature_degc
        self.current_a = 0.0
        self.held_degc = None
        self._since = 0.0

    def temperature_degc(self):
        if self.held_degc is not None:
            return self.held_degc
        elapsed = self.clock.now() - self._since
        self._since = self.clock.now()
        settled = 21.0 + 15.0 * self.current_a
        self.degc = settled + (self.degc - settled) * math.exp(-elapsed / 60.0)
        return self.degc

    def sink_degc(self):
        return 21.5

    def drive(self, current_a):
        self.temperature_degc()
        self.current_a = current_a


@pytest.fixture
def block(clock):
    return Block(clock)


@pytest.fixture
def firmware(clock, block):
    return TecFirmware(clock, block)


@pytest.fixture
def tec(connect, firmware):
    device = Tec(connect(firmware), first_sequence=0xFFF0)
    device.open()
    return device


def test_check_sum_of_the_digits():
    assert crc16(b"123456789") == 0x31C3


@pytest.mark.parametrize(
    ("value", "digits"),
    [(23.0, "41B80000"), (25.0, "41C80000"), (22.34, "41B2B852"), (-40.0, "C2200000"), (25.648026, "41CD2F28")],
)
def test_floats_of_the_sheet(value, digits):
    assert encode_float(value) == digits
    assert decode_float(digits) == pytest.approx(value, rel=1e-7)


def test_integers_are_twos_complement():
    assert encode_int(-2) == "FFFFFFFE"
    assert decode_int("FFFFFFFE") == -2


@pytest.mark.parametrize(("telegram", "answer"), PRINTED + COMPUTED)
def test_telegrams_are_taken_apart_and_made_again(telegram, answer):
    sent, got = decode(telegram), decode(answer)
    assert encode("#", sent.address, sent.sequence, sent.payload) == telegram
    assert got.is_intact or got.acknowledges(sent.crc)
    assert (got.address, got.sequence) == (sent.address, sent.sequence)


@pytest.mark.parametrize("telegram", LONE)
def test_telegrams_printed_alone(telegram):
    frame = decode(telegram)
    assert frame.is_intact
    assert encode(frame.control, frame.address, frame.sequence, frame.payload) == telegram


def test_printed_telegrams_by_the_firmware(clock, block, played):
    block.held_degc = decode_float("41CD2F28")
    firmware = TecFirmware(clock, block, device_type=1089)
    for telegram, answer in PRINTED:
        assert played(firmware, telegram) == answer


def test_computed_telegrams_by_the_firmware(clock, block, played):
    firmware = TecFirmware(clock, block)
    watchdog = COMPUTED[11]
    assert played(firmware, watchdog[0]) == watchdog[1]
    assert played(firmware, b"#01A00CVS080C0100000000" + f"{crc16(b'#01A00CVS080C0100000000'):04X}\r".encode()) != b""
    for i in (2, 3, 0):
        assert played(firmware, COMPUTED[i][0]) == COMPUTED[i][1]
    assert played(firmware, COMPUTED[6][0]) == COMPUTED[6][1]
    clock.sleep(300)
    assert played(firmware, COMPUTED[5][0]) == COMPUTED[5][1]
    block.held_degc = 23.04
    for i in (1, 7, 4, 9, 8):
        assert played(firmware, COMPUTED[i][0]) == COMPUTED[i][1]


def test_computed_telegrams_of_what_the_open_clients_read(clock, block, played):
    firmware = TecFirmware(clock, block)
    values = firmware.memory.values
    flash, device, control, *others = COMPUTED[12:]
    assert played(firmware, flash[0]) == flash[1]
    assert played(firmware, device[0]) == device[1]
    values.update({3000: 23.0, 3003: 0.0, 3010: 12.5, 3011: 0.0})  # 12.5 % a degree and nothing else
    block.held_degc = 22.0
    assert played(firmware, encode("#", 1, 1, "VS07DA0100000001")) != b""
    clock.sleep(1)
    assert played(firmware, control[0]) == control[1]
    values[52200] = 23.0
    for sent, answer in others:
        assert played(firmware, sent) == answer


def test_flash_state(tec, firmware, clock):
    assert tec.session.get(109) == 2  # the driver has switched saving off
    tec.flash_saving_off = False
    tec.kp = 12.0
    assert tec.session.get(109) == 1
    clock.sleep(1)
    assert tec.session.get(109) == 0
    assert tec.session.get(1032) == 0


def test_each_pin_has_its_own_setting(tec):
    tec.session.set(6103, 2, instance=8)
    assert [tec.session.get(6103, instance=pin) for pin in (1, 7, 8)] == [1, 1, 2]
    assert tec.session.metadata(6103, instance=8).instances == 8
    with pytest.raises(DeviceFault, match="instance not available"):
        tec.session.get(6103, instance=0)
    tec.session.set(52000, 1)
    assert tec.session.get(52000) == 0


@pytest.mark.parametrize(
    ("address", "telegram", "answer", "call"),
    [
        (0x00, *PRINTED[0], lambda m: m.request("?IF") == "8065-TEC SW G01     "),
        (0x00, *PRINTED[1], lambda m: m.get(100) == 1089),
        (0x00, *PRINTED[2], lambda m: m.get(102) == 112),
        (0x00, *PRINTED[3], lambda m: m.get(1000) == pytest.approx(25.648026, rel=1e-7)),
        (0x00, *PRINTED[4], lambda m: m.set(3000, 21.75) is None),
        (0x00, *PRINTED[5], lambda m: m.set(2010, 2) is None),
        (0x00, *PRINTED[6], lambda m: m.request("RS") == ""),
        (0x01, *COMPUTED[0], lambda m: m.get(104) == 2),
        (0x01, *COMPUTED[1], lambda m: m.get(1000) == pytest.approx(23.04, rel=1e-6)),
        (0x01, *COMPUTED[2], lambda m: m.set(3000, 23.0) is None),
        (0x01, *COMPUTED[3], lambda m: m.set(2010, 1) is None),
        (0x01, *COMPUTED[4], lambda m: m.set(2010, 0) is None),
        (0x01, *COMPUTED[5], lambda m: m.get(1200) == 2),
        (0x01, *COMPUTED[6], lambda m: m.get(1200) == 1),
        (0x01, *COMPUTED[7], lambda m: m.get(105) == 0),
        (0x01, *COMPUTED[8], lambda m: m.request("RS") == ""),
        (0x01, *COMPUTED[9], lambda m: m.request("ES") == ""),
        (0x01, *COMPUTED[11], lambda m: m.set(2060, 2.0) is None),
        (0x01, *COMPUTED[12], lambda m: m.get(109) == 0),
        (0x01, *COMPUTED[13], lambda m: m.get(1063) == 31.5),
        (0x01, *COMPUTED[14], lambda m: m.get(1032) == 12.5),
        (0x01, *COMPUTED[15], lambda m: m.get(4034) == 3),
        (0x01, *COMPUTED[16], lambda m: m.get(6100) == 0),
        (0x01, *COMPUTED[17], lambda m: m.get(52002) == 0),
        (0x01, *COMPUTED[18], lambda m: m.get(52200) == 23.0),
        (0x01, *COMPUTED[19], lambda m: m.request("?IF01") == "8065-TEC SW G01     "),
        (0x01, *COMPUTED[20], lambda m: m.request("?LT0") == "0"),
        (0x01, *COMPUTED[21], lambda m: m.set(3013, 0.2) is None),
    ],
)
def test_telegrams_by_the_driver(scripted, address, telegram, answer, call):
    session = MeCom(scripted([(telegram, answer)]), address, first_sequence=int(telegram[3:7], 16))
    assert call(session)


@pytest.mark.parametrize(
    ("telegram", "answer", "code"),
    [
        (*COMPUTED[10], 5),
        (b"#01A003VS0BB80141B80000482A\r", b"!01A003+076789\r", 7),
        (*COMPUTED[22], 8),
        (*COMPUTED[23], 6),
    ],
)
def test_refusals(scripted, telegram, answer, code):
    session = MeCom(scripted([(telegram, answer)]), 1, first_sequence=int(telegram[3:7], 16))
    with pytest.raises(DeviceFault) as refused:
        session.request(decode(telegram).payload)
    assert refused.value.code == code


def test_acknowledgement_must_carry_the_commands_check_sum(scripted):
    telegram = COMPUTED[2][0]
    own = encode("!", 1, 0xA003, "")
    session = MeCom(scripted([(telegram, own)] * 3), 1, first_sequence=0xA003)
    with pytest.raises(ProtocolError, match="corrupted answer"):
        session.set(3000, 23.0)


def test_a_retry_uses_the_same_number_and_late_answers_are_dropped(scripted, clock):
    first, answer = COMPUTED[7]
    second = encode("#", 1, 0xA008, "?VR04B001")
    session = MeCom(
        scripted(
            [
                (first, b""),
                (first, answer[:-3] + b"0\r"),  # corrupted
                (first, answer),
                (second, answer + encode("!", 2, 0xA008, "00000002") + encode("!", 1, 0xA008, "00000001")),
            ]
        ),
        1,
        first_sequence=0xA007,
    )
    assert session.get(105) == 0
    assert session.get(1200) == 1
    assert clock.now() > 2.0


def test_no_answer_to_three_tries(scripted):
    session = MeCom(scripted([(COMPUTED[7][0], b"")] * 3), 1, first_sequence=0xA007)
    with pytest.raises(Timeout, match=r"no answer to b'#01A007.*within 1 s, nothing came"):
        session.get(105)


def test_sequence_number_wraps(scripted):
    one, two = (encode("#", 1, n, "?VR006901") for n in (0xFFFF, 0))
    session = MeCom(
        scripted([(one, encode("!", 1, 0xFFFF, "00000000")), (two, encode("!", 1, 0, "00000000"))]),
        1,
        first_sequence=0xFFFF,
    )
    assert session.get(105) == session.get(105) == 0


def test_warm_up_to_stable(tec, firmware, clock, block):
    tec.regulate(23.0)
    status = tec.status()
    assert (status.regulating, status.stable, status.target_degc, status.problem) == (True, False, 23.0, "")
    assert tec.device_status is DeviceStatus.RUN
    assert clock.wait(lambda: firmware.device.loop.stability is Stability.STABLE, 300)
    assert tec.status().stable
    assert tec.temperature_degc == pytest.approx(23.0, abs=0.1)
    tec.off()
    assert tec.output_enable is OutputEnable.OFF
    assert block.current_a == 0
    assert not tec.status().regulating
    assert firmware.memory.flash_writes == 0


def test_no_timer_runs_while_the_output_is_off(tec, clock):
    tec.regulate(23.0)
    tec.close()
    assert clock.next_due() is None


def test_settings_reach_the_flash_only_when_saving_is_on(tec, firmware, clock):
    tec.kp = 12.0
    clock.sleep(1)
    assert firmware.memory.flash_writes == 0
    tec.flash_saving_off = False
    tec.kp, tec.ti_s = 13.0, 50.0
    clock.sleep(1)
    assert firmware.memory.flash_writes == 1
    tec.reset()
    assert (tec.kp, tec.ti_s) == (13.0, 50.0)
    assert tec.flash_saving_off


def test_threshold_trips_and_reset_leaves_the_error(tec, clock):
    tec.upper_threshold_degc = 22.0
    tec.regulate(25.0)
    clock.sleep(120)
    status = tec.status()
    assert status.problem == "error 138: object temperature above threshold"
    assert not status.regulating
    with pytest.raises(DeviceFault, match="error 138"):
        tec.regulate(23.0)
    tec.off()
    tec.reset()
    tec.regulate(21.5)
    assert tec.status().problem == ""


def test_watchdog_stops_the_output_of_a_silent_host(connect, firmware, clock, block):
    tec = Tec(connect(firmware), watchdog_s=2.0)
    tec.open()
    tec.regulate(23.0)
    for _ in range(10):
        clock.sleep(1.0)
        assert tec.status().regulating
    clock.sleep(2.1)
    assert block.current_a == 0
    assert tec.status().problem == "error 183: communication watchdog expired"


def test_emergency_stop(tec, block):
    tec.regulate(23.0)
    tec.emergency_stop()
    assert block.current_a == 0
    assert tec.status().problem == "error 11: emergency stop"


def test_not_stable_in_time(tec, clock):
    tec.stable_max_s = 5.0
    tec.regulate(60.0)
    clock.sleep(10)
    assert tec.error_number == 182


@pytest.mark.parametrize(
    ("payload", "code"),
    [
        ("?VR006402", 8),
        ("?VR000101", 5),
        ("?VR0064", 4),
        ("VS03E80141B80000", 6),
        ("VS07DA0100000009", 7),
        ("VS0BB801FFC00000", 7),
        ("VS0BB80141B8", 4),
        ("?XY", 1),
        ("?LT1", 1),
        ("?LT", 4),
        ("RS1", 4),
    ],
)
def test_refusal_codes(tec, payload, code):
    with pytest.raises(DeviceFault) as refused:
        tec.session.request(payload)
    assert refused.value.code == code


def test_nothing_is_sent_out_of_range(scripted):
    with pytest.raises(LimitError, match="is outside 0 to 4"):
        Tec(scripted([])).current_limit_a = 4.5


def test_identity_with_a_channel_as_the_makers_client_asks(firmware, played):
    assert played(firmware, encode("#", 0, 1, "?IF01")) == encode("!", 0, 1, "8065-TEC SW G01     ")


def test_spoilt_and_foreign_frames_get_no_answer(firmware, played):
    assert played(firmware, b"#01A007?VR006901A8B8\r") == b""
    assert played(firmware, encode("#", 2, 1, "?VR006901")) == b""
    assert played(firmware, encode("#", 0xFF, 1, "ES")) == b""
    assert played(firmware, b"\xff#01A0" + COMPUTED[7][0]) == encode("!", 1, 0xA007, "0000000B")


def test_several_values_at_once(tec):
    assert tec.session.request("?VX02006401006801") == "0000044300000001"
    answer = tec.session.request("?VX0300640103E9010BB801")
    assert answer == encode_int(1091) + encode_float(21.5) + encode_float(25.0)


def test_limits_and_metadata(tec):
    assert tec.session.limits(2030) == (0.0, 4.0)
    found = tec.session.metadata(2010)
    assert (found.kind, found.flags, found.instances, found.elements) == (Kind.INT, 3, 1, 1)
    assert (found.minimum, found.maximum, found.value) == (0, 3, 0)


def test_broadcast_reaches_the_device_without_an_answer(tec, clock):
    tec.regulate(23.0)
    tec.link.write(encode("#", 0xFF, 9, "ES"))
    clock.sleep(0.1)
    assert tec.error_number == 11


def test_rate_falls_back_after_silence(tec, firmware, clock):
    tec.session.request(f"CS{encode_int(9600)}")
    clock.sleep(0.1)
    assert firmware.baud == 9600
    clock.sleep(4.5)
    tec.status()
    clock.sleep(4.5)
    assert firmware.baud == 9600
    clock.sleep(1.0)
    assert firmware.baud == 57600


def test_ramp_leads_the_temperature(tec, clock, block):
    tec.ramp_degc_per_s = 0.05
    tec.proximity_degc = 0.0
    tec.regulate(23.0)
    clock.sleep(20)
    assert tec.nominal_degc == pytest.approx(22.0, abs=0.02)
    assert 21.5 < tec.temperature_degc < 22.0  # a PI loop trails a ramp
    clock.sleep(40)
    assert tec.nominal_degc == pytest.approx(23.0, abs=1e-5)


def test_static_current(tec, clock, block):
    tec.output_stage_input = OutputStageInput.STATIC
    tec.static_current_a = -0.5
    tec.output_enable = OutputEnable.ON
    clock.sleep(1)
    assert block.current_a == -0.5
    assert (tec.output_a, tec.output_v) == (-0.5, -1.0)
    assert tec.stability is Stability.NOT_REGULATING


def test_live_output_needs_live_enable(tec, clock, block):
    tec.output_enable = OutputEnable.LIVE
    assert tec.device_status is DeviceStatus.READY
    tec.live_enable = True
    assert tec.device_status is DeviceStatus.RUN


def test_device_is_silent_while_it_starts(tec, clock):
    tec.session.request("RS")
    assert tec.device_status is DeviceStatus.ABOUT_TO_RESET
    clock.sleep(0.3)
    before = clock.now()
    assert tec.device_status is DeviceStatus.READY  # by a retry
    assert clock.now() - before > 0.8


def test_error_of_an_earlier_hosts_watchdog_is_reset(connect, firmware, clock):
    first = Tec(connect(firmware), watchdog_s=2.0)
    first.open()
    first.regulate(23.0)
    clock.sleep(5)
    assert first.error_number == 183
    first.link.close()
    first.open()
    assert first.error_number == 0
    first.regulate(23.0)


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("lower_threshold_degc", 22.0, 137),
        ("upper_threshold_degc", 20.0, 138),
        ("largest_change_degc_per_s", 1e-4, 139),
        ("current_threshold_a", 0.1, 100),
        ("voltage_threshold_v", 0.1, 104),
    ],
)
def test_thresholds(tec, clock, block, name, value, error):
    setattr(tec, name, value)
    tec.target_degc = 25.0
    tec.output_enable = OutputEnable.ON
    clock.sleep(3)
    assert tec.error_number == error
    assert block.current_a == 0


def test_broken_sensor_switches_off(tec, clock, block):
    tec.regulate(23.0)
    block.held_degc = math.nan
    clock.sleep(1)
    assert tec.error_number == 138
    assert block.current_a == 0


def test_device_that_does_not_come_back_from_a_reset(tec, firmware):
    firmware.device._ready = lambda: None
    with pytest.raises(Timeout, match="did not answer again within 5 s of a reset"):
        tec.reset()


def test_cable_pulled_during_a_reset_is_told_at_once(tec, clock):
    wire = wire_at(tec.link.url)

    def pull():
        wire.plugged = False

    clock.call_at(clock.now() + 0.5, pull)
    with pytest.raises(LinkLost):
        tec.reset()
    assert clock.now() < 1.5


def test_target_out_of_range_sends_nothing(scripted):
    with pytest.raises(LimitError, match=r"target 2000 degC is outside -273\.15 to 1000 degC; nothing was sent"):
        Tec(scripted([])).regulate(2000.0)


@pytest.mark.parametrize(("payload", "code"), [("+05", 5), ("+64", 0x64), ("+FF", 0xFF), ("05", None), ("+5", None)])
def test_refusals_are_two_hex_digits(payload, code):
    assert decode(encode("!", 1, 7, payload)).refusal == code


@pytest.mark.parametrize("digits", ["41B8000", "41B800000", "41b80000", "41B8000G", ""])
def test_numbers_are_eight_capital_hex_digits(digits):
    for read in (decode_float, decode_int):
        with pytest.raises(ValueError, match="eight capital hex digits"):
            read(digits)


@pytest.mark.parametrize(
    "line", [b"", b"#01A007?VR006901A8B\r\n", b"$01A007?VR006901A8B7\r", b"#01a007?VR006901A8B7\r"]
)
def test_what_is_no_frame_is_refused(line):
    with pytest.raises(ValueError, match="is no frame"):
        decode(line)


def test_an_acknowledgement_has_no_payload():
    command = decode(COMPUTED[2][0])
    assert decode(COMPUTED[2][1]).acknowledges(command.crc)
    assert not decode(COMPUTED[2][1]).acknowledges(command.crc ^ 1)
    assert not decode(encode("!", 1, 0xA003, "00000001", crc=command.crc)).acknowledges(command.crc)
    assert encode("#", 0xAB, 0x00CD, "").startswith(b"#AB00CD")
