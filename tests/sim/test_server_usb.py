"""The forwarded bus: what hosts of any manners may ask, and what a busy device does to a transfer."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator

import pytest
import usb.core
import usb.util
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.helios import wire as helios_wire
from picoradar.sim.firmware.helios import HeliosFirmware
from picoradar.sim.server.event_loop import EventLoop
from picoradar.sim.server.usb_operations import ARGUMENTS
from picoradar.sim.server.usb_server import UsbServer
from picoradar.sim.usb import BadFrame, SimUsbBackend, send_frame, take_frame
from picoradar.sim.usb.forward import ForwardBackend, backend
from picoradar.sim.usb.frames import encode_frame, receive_frame


class Still:
    def command(self, x: float, y: float) -> None:
        """Mirrors that nobody looks at."""


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    clock = VirtualClock()
    loop = EventLoop(clock, speed=20.0)
    server = UsbServer(SimUsbBackend(clock, [HeliosFirmware(clock, Still())]), loop)
    stop = threading.Event()

    def serve() -> None:
        while not stop.is_set():
            loop.turn()

    thread = threading.Thread(target=serve)
    thread.start()
    yield server.address
    stop.set()
    thread.join()
    server.close()
    loop.close()


@pytest.fixture
def bus(address: str) -> ForwardBackend:
    return backend(address)


def test_frames_are_the_same_for_any_cut_of_the_stream() -> None:
    frames = [({"op": "a", "n": 1}, b""), ({}, bytes(range(256)) * 10), ({"x": None}, b"z")]
    stream = b"".join(encode_frame(*frame) for frame in frames)
    for piece in (1, 7, 64, len(stream)):
        received, found = bytearray(), []
        for at in range(0, len(stream), piece):
            received += stream[at : at + piece]
            while (frame := take_frame(received)) is not None:
                found.append(frame)
        assert found == frames
        assert not received


DEEP = (500_000).to_bytes(4, "little") + bytes(4) + b"[" * 500_000


@pytest.mark.parametrize("bad", [b"\xff" * 8, b"\x02\0\0\0\0\0\0\0[]", b"\x02\0\0\0\0\0\0\0{!", DEEP])
def test_what_is_no_frame_is_refused(bad: bytes) -> None:
    with pytest.raises(BadFrame):
        take_frame(bytearray(bad))


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63) + 1, 2**63 - 1) | st.text(max_size=5), st.lists, max_leaves=5
)
QUESTIONS = st.fixed_dictionaries(
    {"op": st.sampled_from([*ARGUMENTS, "open", "close", "__class__"]) | JSON},
    optional={
        "handle": st.integers(-1, 3) | JSON,
        "args": st.lists(st.integers(-1, 300), max_size=6) | JSON,
        "device": JSON,
    },
)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(question=QUESTIONS, data=st.binary(max_size=20))
def test_any_question_is_answered_and_harms_nobody(address: str, question: dict, data: bytes) -> None:
    if question.get("op") == "bulk_read" and isinstance(question.get("args"), list):
        question["args"][3:] = [10]  # else it may rightly wait for ever
    host, port = address.split(":")
    with socket.create_connection((host, int(port)), timeout=5) as connection:
        send_frame(connection, question, data)
        answer, _ = receive_frame(connection)
    assert ("result" in answer) != ("error" in answer)


def test_bytes_that_are_no_frame_end_that_connection_only(address: str, bus: ForwardBackend) -> None:
    host, port = address.split(":")
    with socket.create_connection((host, int(port)), timeout=5) as connection:
        connection.sendall(b"\xff" * 64)
        assert connection.recv(1) == b""
    with socket.create_connection((host, int(port)), timeout=5) as connection:
        connection.sendall(DEEP)
        assert connection.recv(1) == b""
    assert len(bus.enumerate_devices()) == 1


def test_the_claims_of_a_host_that_dies_end(address: str) -> None:
    first, second = (usb.core.find(idProduct=0xE500, backend=backend(address)) for _ in range(2))
    usb.util.claim_interface(first, 0)
    with pytest.raises(usb.core.USBError) as busy:
        usb.util.claim_interface(second, 0)
    assert busy.value.errno == 16
    first._ctx.handle.connection.close()  # as when its process is killed
    for _ in range(100):
        try:
            usb.util.claim_interface(second, 0)
            break
        except usb.core.USBError:
            continue
    else:
        pytest.fail("the claim was never given up")
    usb.util.dispose_resources(second)


def test_a_frame_waits_until_the_device_has_room(bus: ForwardBackend) -> None:
    helios = usb.core.find(idProduct=0xE500, backend=bus)
    usb.util.claim_interface(helios, 0)
    helios.set_interface_altsetting(0, 1)
    slow = helios_wire.encode_frame(helios_wire.path_frame([(0, 0), (4095, 4095)] * 10, [False] * 20, 40))  # 0.5 s long
    assert helios.write(helios_wire.EP_FRAME, slow, 1000) == len(slow)
    assert helios.write(helios_wire.EP_FRAME, slow, 1000) == len(slow)  # waits in the second buffer
    with pytest.raises(usb.core.USBTimeoutError):
        helios.write(helios_wire.EP_FRAME, slow, 10)
    assert helios.write(helios_wire.EP_FRAME, slow, 2000) == len(slow)
    usb.util.dispose_resources(helios)


def test_an_address_that_is_none_is_refused() -> None:
    for wrong in ("", "localhost", "127.0.0.1:", ":80", "127.0.0.1:x"):
        with pytest.raises(ValueError, match="host:port"):
            backend(wrong)
