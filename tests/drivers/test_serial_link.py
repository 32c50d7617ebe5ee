"""The serial link: lines in any cut, limits of time and length, and every error of a port under its right name."""

from __future__ import annotations

import os
import threading

import pytest
import serial
from hypothesis import given, settings
from hypothesis import strategies as st

import picoradar.sim.ports  # noqa: F401  (makes sim:// known to pyserial)
from picoradar.drivers.clock import ScaledClock, VirtualClock
from picoradar.drivers.errors import LinkLost, ProtocolError, Timeout
from picoradar.drivers.links import SerialLink
from picoradar.sim.ports import SerialWire, new_bench_name, publish, withdraw
from picoradar.sim.ports.wire import wire_at


class Echo:
    """Sends back what it is sent, piece by piece, each 10 ms after the other."""

    baud = 9600

    def __init__(self, piece=None):
        self.piece = piece

    def connect(self, send):
        self._send = send

    def receive(self, data):
        size = self.piece or len(data)
        for i in range(0, len(data), size):
            self._send(data[i : i + size], 0.01 * (i // size + 1))


@pytest.fixture
def link(connect):
    link = connect(Echo())
    link.open()
    return link


@settings(deadline=None, max_examples=50)
@given(
    lines=st.lists(st.binary(max_size=20).map(lambda line: line.replace(b"\n", b"")), max_size=5),
    piece=st.integers(1, 9),
)
def test_lines_come_whole_in_any_cut(lines, piece):
    clock = VirtualClock()
    url = publish(new_bench_name(), "echo", SerialWire(Echo(piece), clock))
    link = SerialLink(url, clock, device="echo", baud=9600)
    try:
        link.open()
        link.write(b"".join(line + b"\n" for line in lines))
        assert [link.read_until(b"\n") for _ in lines] == [line + b"\n" for line in lines]
    finally:
        link.close()
        withdraw(url)


def test_bytes_take_their_time_on_the_line(link, clock):
    before = clock.now()
    link.write(b"x" * 95 + b"\n")
    link.read_until(b"\n")
    assert clock.now() - before == pytest.approx(2 * 96 * 10 / 9600 + 0.01)


def test_timeout_names_what_was_asked_and_what_came(link, clock):
    link.write(b"half")
    before = clock.now()
    with pytest.raises(Timeout, match=r"no answer to b'half' within 0\.5 s, only b'half' came .check power"):
        link.read_until(b"\n", timeout_s=0.5)
    assert clock.now() - before == pytest.approx(0.5)
    link.discard_input()
    with pytest.raises(Timeout, match=r"within 1 s, nothing came"):
        link.read_until(b"\n")


def test_endless_line_is_a_protocol_error(link):
    link.write(b"x" * 300)
    with pytest.raises(ProtocolError, match="100 bytes without an end of line"):
        link.read_until(b"\n", limit=100)


def test_lines_that_do_not_match_are_dropped_within_one_limit(link, clock):
    link.write(b"a\nb\nc\nd\n")
    assert link.read_match(b"\n", lambda line: line if line.startswith(b"c") else None) == b"c\n"
    assert link.read_until(b"\n") == b"d\n"
    clock.every(0.1, lambda: link.write(b"no\n"))
    before = clock.now()
    with pytest.raises(Timeout):
        link.read_match(b"\n", lambda line: None, timeout_s=2.0)
    assert clock.now() - before < 2.2


def test_drain_waits_for_quiet_but_not_for_ever(connect, clock):
    link = connect(Echo(piece=1))
    link.open()
    link.write(b"late\n")
    assert link.drain(quiet_s=0.05) == b"late\n"
    timer = clock.every(0.02, lambda: link.write(b"x"))
    before = clock.now()
    link.drain(quiet_s=0.1)
    assert clock.now() - before == pytest.approx(1.1, abs=0.1)
    timer.cancel()


def test_leftover_is_taken_without_waiting(link, clock):
    link.write(b"late\n")
    assert link.take_leftover() == b""
    clock.sleep(0.1)
    before = clock.now()
    assert link.take_leftover() == b"late\n"
    assert clock.now() == before


def test_timers_run_while_the_link_waits(link, clock):
    beats = []
    clock.every(0.1, lambda: beats.append(clock.now()))
    with pytest.raises(Timeout):
        link.read_until(b"\n")
    assert len(beats) >= 9


def test_opening_throws_away_what_waits(connect, clock):
    link = connect(Echo())
    link.open()
    link.write(b"old\n")
    clock.sleep(0.1)
    link.close()
    link.open()
    assert link.take_leftover() == b""
    link.open()  # harmless
    assert link.is_open


@pytest.mark.parametrize("pulled_after_s", [0.0, 0.01])
@pytest.mark.parametrize(
    "use",
    [
        lambda link: link.read_until(b"\n"),
        lambda link: link.drain(quiet_s=0.1),
        lambda link: link.clock.sleep(0.01) or link.write(b"x"),
        lambda link: link.clock.sleep(0.01) or link.take_leftover(),
    ],
)
def test_pulled_cable_is_link_lost_and_can_be_plugged_in_again(link, clock, use, pulled_after_s):
    wire = wire_at(link.url)

    def pull():
        wire.plugged = False

    clock.call_at(clock.now() + pulled_after_s, pull)
    with pytest.raises(LinkLost, match=r"the port has gone: .*plug the cable in"):
        use(link)
    assert not link.is_open
    with pytest.raises(LinkLost, match="the port is not open"):
        link.write(b"x")
    with pytest.raises(LinkLost, match="no such port"):
        link.open()
    link.close()
    wire.plugged = True
    link.open()
    link.write(b"again\n")
    assert link.read_until(b"\n") == b"again\n"


def test_bytes_on_the_way_are_lost_with_the_cable(link, clock):
    link.write(b"lost\n")
    wire_at(link.url).plugged = False
    clock.sleep(0.1)
    wire_at(link.url).plugged = True
    link.close()
    link.open()
    link.write(b"kept\n")
    assert link.read_until(b"\n") == b"kept\n"


def test_port_in_use_and_missing_and_no_url(connect, link, clock):
    second = SerialLink(link.url, clock, device="second", baud=9600)
    with pytest.raises(LinkLost, match="in use"):
        second.open()
    with pytest.raises(LinkLost, match="no such port: check the name"):
        SerialLink("/dev/no-such-port", clock, device="x", baud=9600).open()
    with pytest.raises(LinkLost, match="nonsense:// is not opened"):
        SerialLink("nonsense://x", clock, device="x", baud=9600).open()


def refuse(error):
    def serial_for_url(*args, **kwargs):
        raise error

    return serial_for_url


def test_permission_is_named(monkeypatch, clock):
    error = serial.SerialException(13, "could not open port /dev/ttyUSB0: [Errno 13] Permission denied")
    monkeypatch.setattr(serial, "serial_for_url", refuse(error))
    with pytest.raises(LinkLost, match="group"):
        SerialLink("/dev/ttyUSB0", clock, device="x", baud=9600).open()


class BadPort:
    """A port on which everything fails in one way."""

    timeout = 0.0
    in_waiting = 0

    def __init__(self, error):
        self.error = error

    def fail(self, *args):
        raise self.error

    read = write = close = fail

    def reset_input_buffer(self):
        pass


def errors_of_a_port():
    found = [serial.SerialException("read failed"), OSError(5, "Input/output error")]
    termios = pytest.importorskip("termios", reason="termios errors exist on POSIX only")
    return [*found, termios.error(22, "Invalid argument")]


@pytest.mark.parametrize("kind", range(3))
def test_every_error_of_a_port_is_link_lost(monkeypatch, clock, kind):
    port = BadPort(errors_of_a_port()[kind])
    monkeypatch.setattr(serial, "serial_for_url", lambda *args, **kwargs: port)
    link = SerialLink("COM1", clock, device="x", baud=9600)
    for use in (lambda: link.read_until(b"\n"), lambda: link.write(b"x")):
        link.open()
        with pytest.raises(LinkLost):
            use()
        assert not link.is_open


def test_device_that_takes_no_bytes_is_a_timeout(monkeypatch, clock):
    monkeypatch.setattr(
        serial, "serial_for_url", lambda *args, **kwargs: BadPort(serial.SerialTimeoutException("full"))
    )
    link = SerialLink("COM1", clock, device="x", baud=9600)
    link.open()
    with pytest.raises(Timeout, match="did not take 3 bytes"):
        link.write(b"abc")
    assert link.is_open


@pytest.fixture
def pty():
    """Give the two ends of a raw pseudo terminal: a descriptor, and the name of the port."""
    tty = pytest.importorskip("tty", reason="pseudo terminals exist on POSIX only")
    master, slave = os.openpty()
    tty.setraw(slave)
    ends = [master, slave]
    yield master, os.ttyname(slave), ends
    for end in ends:
        os.close(end)


def test_on_a_pty_with_wall_time(pty):
    master, port, _ = pty

    def answer():
        os.write(master, os.read(master, 64) + b" yes\r\n")

    device = threading.Thread(target=answer)
    device.start()
    link = SerialLink(port, ScaledClock(), device="pty", baud=9600)
    link.open()
    try:
        link.write(b"there?")
        assert link.read_until(b"\r\n") == b"there? yes\r\n"
    finally:
        link.close()
        device.join()


def test_pulled_pty_is_link_lost(pty):
    _, port, ends = pty
    link = SerialLink(port, ScaledClock(), device="pty", baud=9600)
    link.open()
    for end in list(ends):
        ends.remove(end)
        os.close(end)
    with pytest.raises(LinkLost):
        link.read_until(b"\n")
    assert not link.is_open
