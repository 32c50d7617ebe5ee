"""Served serial devices as plain pyserial programs meet them, on ptys and TCP ports."""

from __future__ import annotations

import os
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
import serial

from picoradar.drivers.clock import ScaledClock, VirtualClock
from picoradar.drivers.dg645 import DG645
from picoradar.drivers.errors import LinkLost
from picoradar.drivers.links import SerialLink
from picoradar.instrument.bench.port_probe import Answer, identify_port
from picoradar.sim.firmware.dg645 import Dg645Firmware
from picoradar.sim.firmware.genesys import GenesysFirmware
from picoradar.sim.wires import InterlockChain, TriggerLine

GOLDEN = Path(__file__).parents[1] / "golden"
IDENTITY = b"Stanford Research Systems,DG645,s/n001013,ver1.02.0A\r\n"
needs_ptys = pytest.mark.skipif(os.name != "posix", reason="there are no ptys on this system")
BOTH = [pytest.param("pty", marks=needs_ptys), "socket"]


def dg645(clock: VirtualClock) -> Dg645Firmware:
    return Dg645Firmware(clock, TriggerLine(), InterlockChain())


def genesys(clock: VirtualClock) -> GenesysFirmware:
    return GenesysFirmware(clock, InterlockChain())


def exchange(name: str) -> list[tuple[bytes, bytes]]:
    rows = tomllib.loads((GOLDEN / f"{name}.toml").read_text())["exchange"]
    return [(sent.encode(), "".join(answers).encode()) for sent, *answers in rows]


class Talker:
    """A device that keeps what it hears and answers as scripted."""

    baud = 9600

    def __init__(self) -> None:
        self.heard = b""

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        self.say = lambda data: send(data, 0.0)

    def receive(self, data: bytes) -> None:
        self.heard += data


def opened(url: str, **settings: object) -> serial.SerialBase:
    return serial.serial_for_url(url, **{"baudrate": 9600, "timeout": 2.0, **settings})


def ask(port: serial.SerialBase, sent: bytes, answer: bytes) -> bytes:
    port.write(sent)
    return port.read(len(answer)) if answer else b""


@pytest.mark.parametrize("kind", BOTH)
@pytest.mark.parametrize(("firmware", "rows"), [(dg645, 16), (genesys, 11)])
def test_the_worked_exchange_of_the_sheet(serve, kind: str, firmware: Callable, rows: int) -> None:
    with opened(serve(firmware).url(kind)) as port:
        for sent, answer in exchange(firmware.__name__)[:rows]:
            assert ask(port, sent, answer) == answer, sent
        port.timeout = 0.05
        assert port.read(1) == b""


@pytest.mark.parametrize("kind", BOTH)
def test_a_host_that_writes_byte_by_byte_and_opens_again(serve, kind: str) -> None:
    url = serve().url(kind)
    for _ in range(2):
        with opened(url) as port:
            for byte in b"*IDN?\n":
                port.write(bytes([byte]))
            assert port.read(len(IDENTITY)) == IDENTITY
        time.sleep(0.02)


@needs_ptys
def test_nothing_is_echoed_to_the_device_before_a_host_opens(serve) -> None:
    served = serve(lambda _: Talker())
    served.do(lambda: served.firmware.say(b"ready\r\n"))
    time.sleep(0.05)
    with opened(served.url("pty")) as port:
        port.write(b"a")
        time.sleep(0.05)
    assert served.firmware.heard == b"a"


@needs_ptys
def test_all_byte_values_pass_unchanged(serve) -> None:
    served = serve(lambda _: Talker())
    every_byte = bytes(range(256))
    with opened(served.url("pty")) as port:
        port.write(every_byte)
        served.do(lambda: served.firmware.say(every_byte))
        assert port.read(256) == every_byte
    assert served.firmware.heard == every_byte


@needs_ptys
@pytest.mark.parametrize("baud", [4800, 19200, 250_000])
def test_a_wrong_baud_rate_gives_garbage_both_ways(serve, baud: int) -> None:
    served = serve(lambda _: Talker())
    with opened(served.url("pty"), baudrate=baud, timeout=0.2) as port:
        served.do(lambda: served.firmware.say(IDENTITY))
        came = port.read(200)
        assert came
        assert b"DG645" not in came
        port.write(b"*IDN?\n")
        time.sleep(0.05)
        port.baudrate = 9600
        port.write(b"*IDN?\n")
        served.do(lambda: served.firmware.say(IDENTITY))
        port.timeout = 2.0
        assert port.read(len(IDENTITY)) == IDENTITY
    garbage = served.firmware.heard.removesuffix(b"*IDN?\n")
    assert garbage
    assert b"IDN" not in garbage


@pytest.mark.parametrize("kind", BOTH)
def test_an_answer_takes_ten_bits_a_byte(serve, kind: str) -> None:
    with opened(serve(speed=1.0).url(kind)) as port:
        began = time.monotonic()
        port.write(b"*IDN?\n")
        assert port.read(1) == IDENTITY[:1]
        first_s = time.monotonic() - began
        assert port.read(len(IDENTITY) - 1) == IDENTITY[1:]
        whole_s = time.monotonic() - began
    line_s = 10 * (len(IDENTITY) + 6) / 9600
    assert whole_s >= line_s * 0.95  # a busy computer may make it slower, nothing makes it faster
    assert first_s < whole_s - 0.02  # the bytes trickle in, they do not come in a lump


def test_a_second_host_on_the_tcp_port_is_turned_away(serve) -> None:
    url = serve().url("socket")
    with opened(url) as first:
        assert ask(first, b"*IDN?\n", IDENTITY) == IDENTITY
        with opened(url, timeout=1.0) as second, pytest.raises(serial.SerialException, match="disconnected"):
            second.read(1)
        assert ask(first, b"*IDN?\n", IDENTITY) == IDENTITY


@needs_ptys
def test_a_host_on_the_tcp_port_has_the_line(serve) -> None:
    served = serve()
    with opened(served.url("pty"), timeout=0.2) as on_pty:
        with opened(served.url("socket")) as on_socket:
            assert ask(on_socket, b"*IDN?\n", IDENTITY) == IDENTITY
            assert ask(on_pty, b"*IDN?\n", IDENTITY) == b""
        time.sleep(0.05)
        on_pty.timeout = 2.0
        assert ask(on_pty, b"*IDN?\n", IDENTITY) == IDENTITY


@needs_ptys
def test_cable_pull_and_plug_of_a_pty(serve) -> None:
    served = serve()
    with opened(served.url("pty")) as port:
        assert ask(port, b"*IDN?\n", IDENTITY) == IDENTITY
        served.do(served.port.pull)
        with pytest.raises(serial.SerialException):
            port.read(1)
    with pytest.raises(serial.SerialException) as refused:
        opened(served.url("pty"))
    assert refused.value.errno == 2
    served.do(served.port.plug)
    with opened(served.url("pty")) as port:
        assert ask(port, b"*IDN?\n", IDENTITY) == IDENTITY


def test_cable_pull_and_plug_of_a_tcp_port(serve) -> None:
    served = serve()
    url = served.url("socket")
    with opened(url) as port:
        served.do(served.port.pull)
        with pytest.raises(serial.SerialException):
            port.read(1)
        with pytest.raises(serial.SerialException, match="refused"):
            opened(url)
        served.do(served.port.plug)
    with opened(url) as port:
        assert ask(port, b"*IDN?\n", IDENTITY) == IDENTITY


@pytest.mark.parametrize("kind", BOTH)
def test_a_driver_sees_the_cable_go_and_knows_the_device_again(serve, kind: str) -> None:
    served = serve()
    device = DG645(SerialLink(served.url(kind), ScaledClock(), device="DG645", baud=9600))
    device.open()
    before = device.identify()
    served.do(served.port.pull)
    with pytest.raises(LinkLost, match="connect again"):
        device.identify()
    with pytest.raises(LinkLost):
        device.open()
    served.do(served.port.plug)
    device.open()
    assert device.identify() == before
    device.close()


@needs_ptys
def test_a_second_program_on_a_pty_is_told_that_it_is_in_use(serve) -> None:
    url = serve().url("pty")
    first, second = (SerialLink(url, ScaledClock(), device="DG645", baud=9600) for _ in range(2))
    first.open()
    with pytest.raises(LinkLost, match="another program has it open"):
        second.open()
    first.close()
    second.open()
    second.close()


@needs_ptys
def test_the_rate_at_which_a_device_answers_is_found(serve) -> None:
    url = serve().url("pty")
    assert identify_port(url, ScaledClock(), expected="dg645", baud=19200, genesys_address=6) == Answer("dg645", 9600)
    assert identify_port(url, ScaledClock(), expected="genesys", baud=9600, genesys_address=6) == Answer("dg645", 9600)
