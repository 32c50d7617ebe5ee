"""What must hold for any cut and any damage of a serial stream, for all devices on serial lines.

Cuts never change what is understood. Damaged bytes never hang a driver, and it finds back by itself; where a
check sum exists, wrong data never pass for good.
"""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.dg645 import DG645
from picoradar.drivers.errors import DeviceError
from picoradar.drivers.genesys import Genesys
from picoradar.drivers.genesys.wire import decode as decode_genesys
from picoradar.drivers.genesys.wire import encode as encode_genesys
from picoradar.drivers.links import SerialLink
from picoradar.drivers.mecom import Tec
from picoradar.drivers.mecom import decode as decode_mecom
from picoradar.drivers.mecom import encode as encode_mecom
from picoradar.drivers.tc200.driver import TC200
from picoradar.sim.firmware.dg645 import Dg645Firmware
from picoradar.sim.firmware.genesys import GenesysFirmware
from picoradar.sim.firmware.lines import LineReader
from picoradar.sim.firmware.mecom import TecFirmware
from picoradar.sim.firmware.tc200.device import Tc200Firmware
from picoradar.sim.ports import SerialWire, new_bench_name, publish, withdraw
from picoradar.sim.wires import InterlockChain, TriggerLine

# Derandomised: a 16-bit check sum lets one random damage in 65536 pass, and a test must not depend on luck.
QUICK = settings(deadline=None, max_examples=60, derandomize=True)
BOUND_S = 30.0  # no call of a driver may take longer, whatever comes


class Block:
    """A diode block at a fixed temperature."""

    def temperature_degc(self):
        return 23.04

    def sink_degc(self):
        return 21.0

    def drive(self, current_a):
        pass


FIRMWARES = {
    "dg645": lambda clock: Dg645Firmware(clock, TriggerLine(), InterlockChain()),
    "genesys": lambda clock: GenesysFirmware(clock, InterlockChain()),
    "mecom": lambda clock: TecFirmware(clock, Block()),
    "tc200": lambda clock: Tc200Firmware(clock, Block()),
}
STREAMS = {
    "dg645": b"*IDN?\nTRAT 80000\nTRAT?\nDLAY 2,0,1e-7\nDLAY?2\r\nFOO\nLERR?\n\nLAMP 1,3.3\nLAMP?1\n",
    "genesys": b"ADR 6\rIDN?\rPV 29\x0880\rPV?\rOUT?$E3\r\\\rFOO\r\rDVC?\r",
    "mecom": b"junk#01A0#01A002?VR03E8016A8C\r#01A003VS0BB80141B80000482A\r#01A00A?VR0BB801E238\r",
    "tc200": b"*idn?\rtset=40\rtset?\rfoo\rstat?\rmode=normal\r\rens\rstat?\r",
}


def answers_to(name, pieces):
    clock = VirtualClock()
    firmware = FIRMWARES[name](clock)
    came = bytearray()
    firmware.connect(lambda data, delay_s: came.extend(data))
    for piece in pieces:
        firmware.receive(piece)
    return bytes(came)


def cut(stream, places):
    marks = [0, *sorted(place % (len(stream) + 1) for place in places), len(stream)]
    return [stream[a:b] for a, b in pairwise(marks)]


edits = st.lists(
    st.tuples(st.sampled_from(["flip", "drop", "double", "insert"]), st.integers(0, 60), st.integers(1, 255)),
    min_size=1,
    max_size=4,
)


def damage(stream, changes):
    out = bytearray(stream)
    for kind, place, byte in changes:
        at = place % (len(out) + 1)
        if kind == "insert":
            out.insert(at, byte)
        elif at < len(out):
            if kind == "flip":
                out[at] ^= byte
            elif kind == "drop":
                del out[at]
            else:
                out.insert(at, out[at])
    return bytes(out)


@pytest.mark.parametrize("name", FIRMWARES)
@QUICK
@given(places=st.lists(st.integers(0, 10_000), max_size=12))
def test_any_cut_gives_the_same_answers(name, places):
    assert answers_to(name, cut(STREAMS[name], places)) == answers_to(name, [STREAMS[name]])


@pytest.mark.parametrize("name", FIRMWARES)
def test_byte_by_byte_gives_the_same_answers(name):
    whole = answers_to(name, [STREAMS[name]])
    assert whole
    assert answers_to(name, [bytes([byte]) for byte in STREAMS[name]]) == whole


@QUICK
@given(st.binary(max_size=200), st.lists(st.integers(0, 10_000), max_size=12))
def test_line_reader_keeps_its_limit(stream, places):
    reader, whole = LineReader(b"\r\n", limit=20), LineReader(b"\r\n", limit=20)
    lines = [line for piece in cut(stream, places) for line in reader.feed(piece)]
    assert lines == whole.feed(stream)
    assert all(len(line) <= 21 for line in lines)
    assert lines == [line[:21] for line in stream.replace(b"\n", b"\r").split(b"\r")[:-1]]


@pytest.mark.parametrize("name", FIRMWARES)
@QUICK
@given(changes=edits)
def test_firmware_survives_damage(name, changes):
    answers_to(name, [damage(STREAMS[name], changes)])


@pytest.mark.parametrize("name", FIRMWARES)
@QUICK
@given(noise=st.binary(max_size=400))
def test_firmware_survives_noise(name, noise):
    answers_to(name, [noise, b"\r\n"])


@QUICK
@given(changes=edits)
def test_damaged_telegram_is_not_carried_out(changes):
    good = encode_mecom("#", 1, 0xA003, "VS0BB80141B80000")
    firmware = TecFirmware(VirtualClock(), Block())
    firmware.connect(lambda data, delay_s: None)
    firmware.receive(damage(good, changes) + b"\r")
    assert firmware.memory.values[3000] in (25.0, 23.0)


@QUICK
@given(changes=edits)
def test_damaged_mecom_frame_is_not_intact(changes):
    good = encode_mecom("!", 1, 0xA002, "41B851EC")
    for line in damage(good, changes).split(b"\r"):
        try:
            frame = decode_mecom(line)
        except ValueError:
            continue
        assert not frame.is_intact or frame == decode_mecom(good)


@QUICK
@given(change=edits.map(lambda changes: changes[:1]), volts=st.integers(0, 63000))
def test_damaged_genesys_reply_is_not_taken(change, volts):
    text = f"{volts / 100:.2f}"
    for line in damage(encode_genesys(text, with_checksum=True), change).split(b"\r"):
        try:
            assert decode_genesys(line, with_checksum=True) == text
        except ValueError:
            continue


class Damaged:
    """A device on a bad line: damages the next bytes in one direction, then works again."""

    def __init__(self, firmware, changes, towards_host):
        self.firmware = firmware
        self.baud = firmware.baud
        self.changes = changes
        self.towards_host = towards_host
        self.armed = False

    def connect(self, send):
        def sending(data, delay_s):
            send(self._spoil(data) if self.towards_host else data, delay_s)

        self.firmware.connect(sending)

    def receive(self, data):
        self.firmware.receive(data if self.towards_host else self._spoil(data))

    def _spoil(self, data):
        if not self.armed:
            return data
        self.armed = False
        return damage(data, self.changes)


# How to make the driver, a question with its right answer, and whether a check sum guards the answer.
DRIVERS = {
    "dg645": ("dg645", DG645, lambda d: d.trigger_rate_hz, 1000.0, False),
    "genesys": ("genesys", Genesys, lambda d: d.overvoltage_v, 660.0, False),
    "genesys with check sum": (
        "genesys",
        lambda link: Genesys(link, checksum=True),
        lambda d: d.overvoltage_v,
        660.0,
        True,
    ),
    "mecom": ("mecom", Tec, lambda d: round(d.temperature_degc, 4), 23.04, True),
    "tc200": ("tc200", TC200, lambda d: d.target_degc, 25.0, False),
}


@pytest.mark.parametrize("name", DRIVERS)
@pytest.mark.parametrize("towards_host", [True, False])
@QUICK
@given(changes=edits)
def test_driver_survives_damage_and_finds_back(name, towards_host, changes):
    device_name, make, ask, right, guarded = DRIVERS[name]
    clock = VirtualClock()
    line = Damaged(FIRMWARES[device_name](clock), changes, towards_host)
    url = publish(new_bench_name(), "device", SerialWire(line, clock))
    try:
        device = make(SerialLink(url, clock, device=name, baud=line.baud))
        device.open()
        start = clock.now()
        line.armed = True
        try:
            answer = ask(device)
            assert math.isfinite(answer)
            assert answer == right or not guarded
        except DeviceError:
            pass
        assert clock.now() - start < BOUND_S
        clock.sleep(1.0)  # what is still under way arrives
        if towards_host:
            assert ask(device) == right
        else:
            device.identify()  # the damaged command may have been another, valid one
        device.close()
    finally:
        withdraw(url)


@pytest.mark.parametrize("name", DRIVERS)
def test_chatter_does_not_hold_a_driver_up(name, connect, clock):
    class Chatter:
        baud = 9600

        def connect(self, send):
            self.timer = clock.every(0.01, lambda: send(b"!06\r!05\r> \r\n", 0.0))

        def receive(self, data):
            pass

    chatter = Chatter()
    _, make, _, _, _ = DRIVERS[name]
    device = make(connect(chatter))
    with pytest.raises(DeviceError):
        device.open()
    assert clock.now() < BOUND_S
    chatter.timer.cancel()
