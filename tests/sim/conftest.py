"""A simulated device behind its served ports, for the tests of the server."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from picoradar.drivers.clock import VirtualClock
from picoradar.sim.firmware.dg645 import Dg645Firmware
from picoradar.sim.ports import SerialFirmware, SerialWire
from picoradar.sim.server.event_loop import EventLoop
from picoradar.sim.server.served_port import ServedPort
from picoradar.sim.wires import InterlockChain, TriggerLine


def _dg645(clock: VirtualClock) -> Dg645Firmware:
    return Dg645Firmware(clock, TriggerLine(), InterlockChain())


class Served:
    """A firmware behind its ports, served by a thread; `do` runs something in that thread."""

    def __init__(self, make: Callable[[VirtualClock], SerialFirmware], folder: Path, speed: float) -> None:
        clock = VirtualClock()
        self.loop = EventLoop(clock, speed)
        self.firmware = make(clock)
        self.wire = SerialWire(self.firmware, clock)
        self.port = ServedPort(self.wire, self.loop, folder / "port" if os.name == "posix" else None)
        self._jobs: list[Callable[[], None]] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def url(self, kind: str) -> str:
        return str(self.port.addresses[kind])

    def do(self, job: Callable[[], None]) -> None:
        done = threading.Event()
        self._jobs.append(lambda: (job(), done.set()))
        assert done.wait(5)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.port.close()
        self.loop.close()

    def _run(self) -> None:
        while not self._stop.is_set():
            while self._jobs:
                self._jobs.pop(0)()
            self.loop.turn()


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Served]]:
    with ExitStack() as stack:

        def make(firmware: Callable[[VirtualClock], SerialFirmware] = _dg645, speed: float = 20.0) -> Served:
            served = Served(firmware, tmp_path, speed)
            stack.callback(served.close)
            return served

        yield make
