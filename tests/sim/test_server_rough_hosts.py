"""Hosts that flood, do not read, vanish, or find the server without descriptors: one ends, the bench goes on."""

from __future__ import annotations

import errno
import json
import os
import select
import socket
import struct
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial

from picoradar.drivers.clock import VirtualClock
from picoradar.sim import SimulatedBench
from picoradar.sim.firmware.dg645 import Dg645Firmware
from picoradar.sim.ports import SerialWire
from picoradar.sim.server import BenchServer, FolderInUse
from picoradar.sim.server.event_loop import EventLoop
from picoradar.sim.server.listener import Listener
from picoradar.sim.server.usb_server import UsbServer
from picoradar.sim.usb import SimUsbBackend
from picoradar.sim.usb.frames import encode_frame, receive_frame
from picoradar.sim.wires import InterlockChain, TriggerLine

IDENTITY = b"Stanford Research Systems,DG645,s/n001013,ver1.02.0A\r\n"
FLOOD = 1 << 20  # bytes; 18 min at 9600 baud
needs_ptys = pytest.mark.skipif(os.name != "posix", reason="there are no ptys on this system")


def connected(url: str) -> socket.socket:
    host, _, port = url.removeprefix("socket://").rpartition(":")
    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 8192)  # else the system takes megabytes of them
    made.settimeout(5.0)
    made.connect((host, int(port)))
    return made


def pushed(host: socket.socket, text: bytes) -> int:
    """Write without reading until the other end takes no more for 0.3 s; return the bytes taken."""
    host.setblocking(False)
    taken = 0
    while taken < FLOOD and select.select([], [host], [], 0.3)[1]:
        taken += host.send(text * 1000)
    return taken


@pytest.mark.parametrize("text", [b"AAAAAAAAAA", b"*IDN?\n"], ids=["no end of line", "questions"])
def test_a_host_that_floods_is_made_to_wait_and_leaves_a_responsive_device(serve, text: bytes) -> None:
    served = serve(speed=1.0)
    with connected(served.url("socket")) as flood:
        assert pushed(flood, text) < FLOOD // 4
        assert served.wire.crossing < 1 << 16
    with serial.serial_for_url(served.url("socket"), timeout=2.0) as port:
        port.write(b"\n*IDN?\n")
        assert port.read(len(IDENTITY)) == IDENTITY


def test_a_host_that_is_made_to_wait_loses_nothing(serve) -> None:
    asked = 300  # 2100 bytes of questions, 16 kB of answers
    with serial.serial_for_url(serve(speed=50.0).url("socket"), timeout=5.0) as port:
        port.write(b"*IDN? \n" * asked)
        assert port.read(asked * len(IDENTITY)) == asked * IDENTITY


def test_what_is_on_the_line_of_a_host_that_hangs_up_reaches_nobody() -> None:
    clock = VirtualClock()
    wire = SerialWire(Dg645Firmware(clock, TriggerLine(), InterlockChain()), clock)
    wire.host_open = True
    wire.write(b"*IDN?\n" * 1000)
    clock.sleep(8.0)  # all questions are there, most answers on their way
    wire.write(b"A" * 100_000)
    wire.hang_up()
    assert (wire.crossing, wire.waiting) == (0, 0)
    wire.write(b"\n*IDN?\n")
    assert wire.read(len(IDENTITY), 1.0) == IDENTITY
    assert wire.read(1, 200.0) == b""
    assert wire.crossing == 0


@needs_ptys
def test_a_flood_on_a_pty_is_made_to_wait(serve) -> None:
    served = serve(speed=1.0)
    terminal = os.open(served.url("pty"), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    taken = 0
    while taken < FLOOD and select.select([], [terminal], [], 0.3)[1]:
        taken += os.write(terminal, b"A" * 1000)
    os.close(terminal)
    assert taken < FLOOD // 4
    with serial.serial_for_url(served.url("socket"), timeout=2.0) as port:  # a host there has the line
        port.write(b"\n*IDN?\n")
        assert port.read(len(IDENTITY)) == IDENTITY


@needs_ptys
def test_a_pty_that_is_hung_up_carries_nothing(serve) -> None:
    with serial.serial_for_url(serve().url("pty"), baudrate=9600, timeout=2.0) as port:
        port.baudrate = 0
        port.write(b"*RST\n*IDN?\n")
        port.timeout = 0.1
        assert port.read(1) == b""
        port.baudrate, port.timeout = 9600, 2.0
        port.write(b"*IDN?\n")
        assert port.read(len(IDENTITY)) == IDENTITY


@pytest.mark.skipif(sys.platform != "linux", reason="the table of connections is that of Linux")
def test_a_host_that_vanishes_without_a_word_is_noticed(serve) -> None:
    with connected(serve().url("socket")) as host:
        host.sendall(b"*IDN?\n")
        assert host.recv(1) == IDENTITY[:1]
        ours = f":{host.getpeername()[1]:04X}", f":{host.getsockname()[1]:04X}"
        rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        timers = [row[5] for row in rows if row[1].endswith(ours[0]) and row[2].endswith(ours[1])]
    assert [timer[:2] for timer in timers] == ["02"]  # a timer of keep-alive runs


# ---- the forwarded bus


@pytest.fixture
def usb() -> Iterator[tuple[EventLoop, tuple[str, int]]]:
    clock = VirtualClock()
    loop = EventLoop(clock, speed=20.0)
    server = UsbServer(SimUsbBackend(clock), loop)
    host, _, port = server.address.rpartition(":")
    yield loop, (host, int(port))
    server.close()
    loop.close()


def still_serves(loop: EventLoop, address: tuple[str, int]) -> bool:
    with socket.create_connection(address, timeout=5) as host:
        host.sendall(encode_frame({"op": "enumerate"}))
        for _ in range(5):
            loop.turn()
        return receive_frame(host) == ({"result": []}, b"")


def test_brackets_by_the_thousand_end_one_connection_and_not_the_bench(usb) -> None:
    loop, address = usb
    with socket.create_connection(address, timeout=5) as host:
        host.sendall(struct.pack("<II", 100_000, 0) + b"[" * 100_000)
        for _ in range(8):
            loop.turn()
        assert host.recv(1) == b""
    assert still_serves(loop, address)


def test_a_refusal_does_not_repeat_what_it_refuses(usb) -> None:
    loop, address = usb
    with socket.create_connection(address, timeout=5) as host:
        host.sendall(encode_frame({"op": "x" * 100_000, "args": [[[0]]] * 10_000}))
        for _ in range(8):
            loop.turn()
        answer, _ = receive_frame(host)
        assert answer["errno"] == errno.ENOTSUP
        assert len(str(answer)) < 300
    assert still_serves(loop, address)


def test_questions_that_do_not_wait_for_their_answers_end_the_connection(usb) -> None:
    loop, address = usb
    with socket.create_connection(address, timeout=5) as host:
        host.sendall(encode_frame({"op": "speed"}) * 1000)
        for _ in range(5):
            loop.turn()
        with pytest.raises(ConnectionError):
            receive_frame(host)
    assert still_serves(loop, address)


# ---- a computer that has no descriptors left


def test_a_host_that_cannot_be_accepted_is_tried_again_without_haste(monkeypatch: pytest.MonkeyPatch) -> None:
    loop, hosts, attempts = EventLoop(VirtualClock()), list[socket.socket](), 0
    accept = socket.socket.accept

    def exhausted(listener: socket.socket) -> tuple[socket.socket, object]:
        nonlocal attempts
        attempts += 1
        raise OSError(errno.EMFILE, "Too many open files")

    listener = Listener(loop, hosts.append)
    monkeypatch.setattr(socket.socket, "accept", exhausted)
    with socket.create_connection(("127.0.0.1", listener.port), timeout=5):
        for _ in range(4):
            loop.turn()
        assert attempts == 1
        monkeypatch.setattr(socket.socket, "accept", accept)
        while not hosts:
            loop.turn()
        hosts[0].close()
    listener.close()
    loop.close()


# ---- the folder


def test_a_folder_belongs_to_one_server_at_a_time(tmp_path: Path) -> None:
    with SimulatedBench({"target": "plate"}) as one, SimulatedBench({"target": "plate"}) as other:
        first = BenchServer(one, tmp_path)
        names = sorted(tmp_path.iterdir())
        with pytest.raises(FolderInUse, match=rf"process {os.getpid()}\)"):
            BenchServer(other, tmp_path)
        assert sorted(tmp_path.iterdir()) == names
        first.close()
        assert not list(tmp_path.iterdir())
        BenchServer(other, tmp_path).close()


@needs_ptys
def test_only_names_of_its_own_are_made_and_taken_away(tmp_path: Path) -> None:
    (tmp_path / "tec").write_text(json.dumps("notes of somebody"))
    with SimulatedBench({"target": "plate"}) as bench:
        with pytest.raises(FileExistsError, match="tec is there already"):
            BenchServer(bench, tmp_path)
        assert [path.name for path in tmp_path.iterdir()] == ["tec"]
        (tmp_path / "tec").unlink()
        with BenchServer(bench, tmp_path):
            (tmp_path / "tec").unlink()
            (tmp_path / "tec").symlink_to("/dev/null")  # somebody else's now
        assert [path.name for path in tmp_path.iterdir()] == ["tec"]
