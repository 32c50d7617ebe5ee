"""Kit for byte-exact driver tests: a scripted device on a real link, in virtual time.

``scripted([(sent, reply), ...])`` gives a `SerialLink` to a device that expects exactly these bytes in this
order, and answers with these. A byte too many, too few or different fails the test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import pytest

import picoradar.sim.ports  # noqa: F401  (makes sim:// known to pyserial)
from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.links import SerialLink
from picoradar.sim.ports import SerialFirmware, SerialWire, new_bench_name, publish, withdraw

Exchange = tuple[bytes, bytes]


class Script:
    """A device that plays a list of exchanges; satisfies `picoradar.sim.ports.wire.SerialFirmware`."""

    baud = 9600

    def __init__(self, exchanges: Sequence[Exchange]) -> None:
        self.left = list(exchanges)
        self._came = b""
        self._send: Callable[[bytes, float], None] = lambda data, delay_s: None

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        self._send = send

    def receive(self, data: bytes) -> None:
        self._came += data
        while self._came:
            assert self.left, f"nothing more was expected, but {self._came!r} came"
            sent, reply = self.left[0]
            assert sent.startswith(self._came) or self._came.startswith(sent), f"expected {sent!r}, got {self._came!r}"
            if len(self._came) < len(sent):
                return
            self._came = self._came[len(sent) :]
            self.left.pop(0)
            if reply:
                self._send(reply, 0.001)


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


@pytest.fixture
def connect(clock: VirtualClock) -> Iterator[Callable[..., SerialLink]]:
    """Give a function that puts a firmware on a simulated line and returns an unopened link to it."""
    urls: list[str] = []

    def make(firmware: SerialFirmware, *, timeout_s: float = 1.0) -> SerialLink:
        urls.append(publish(new_bench_name(), "device", SerialWire(firmware, clock)))
        return SerialLink(urls[-1], clock, device="device", baud=firmware.baud, timeout_s=timeout_s)

    yield make
    for url in urls:
        withdraw(url)


@pytest.fixture
def scripted(clock: VirtualClock, connect: Callable[..., SerialLink]) -> Iterator[Callable[..., SerialLink]]:
    """Give a function that returns an open link to a `Script`; afterwards nothing may be left over."""
    scripts: list[Script] = []

    def play(exchanges: Sequence[Exchange], *, timeout_s: float = 1.0) -> SerialLink:
        script = Script(exchanges)
        scripts.append(script)
        link = connect(script, timeout_s=timeout_s)
        link.open()
        return link

    yield play
    clock.sleep(1.0)  # lets the last bytes arrive
    for script in scripts:
        assert not script.left, f"never sent: {[sent for sent, _ in script.left]}"


@pytest.fixture
def played(clock: VirtualClock) -> Callable[[SerialFirmware, bytes], bytes]:
    """Give a function that hands bytes to a firmware and returns all that it answers within half a second."""
    answers: dict[int, bytearray] = {}

    def play(firmware: SerialFirmware, sent: bytes) -> bytes:
        if id(firmware) not in answers:
            came = answers[id(firmware)] = bytearray()
            firmware.connect(lambda data, delay_s: came.extend(data))
        firmware.receive(sent)
        clock.sleep(0.5)
        got = bytes(answers[id(firmware)])
        answers[id(firmware)].clear()
        return got

    return play
