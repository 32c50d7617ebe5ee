"""A bench with the two USB devices, on the virtual clock."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from picoradar.drivers.bridge import SamplingBridge, bridge_link, sbp
from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.helios import Helios, helios_link
from picoradar.sim.firmware.bridge import SamplingBridgeFirmware
from picoradar.sim.firmware.helios import HeliosFirmware
from picoradar.sim.usb import SimUsbBackend
from picoradar.sim.wires import Acquisition, InterlockChain, TriggerLine

GOLDEN = Path(__file__).parents[2] / "golden"


@dataclass
class SeenMirrors:
    """Mirrors that remember each command and its moment."""

    clock: VirtualClock
    seen: list[tuple[float, float, float]] = field(default_factory=list)

    def command(self, x: float, y: float) -> None:
        self.seen.append((self.clock.now(), x, y))


@dataclass
class Ramp:
    """A signal source whose codes tell which measurement they are of."""

    clipped: bool = False
    wanted: list[Acquisition] = field(default_factory=list)

    def acquire(self, wanted: Acquisition) -> NDArray[np.uint32]:
        self.wanted.append(wanted)
        shift = 7 * wanted.key[1] + 3 * wanted.key[2] + wanted.key[3]
        return ((np.arange(wanted.samples, dtype=np.uint32) + shift) % 200) * wanted.sweeps


class UsbBench:
    """Helios DAC and sampling bridge on one simulated bus."""

    def __init__(self, version: int) -> None:
        self.clock = VirtualClock()
        self.mirrors = SeenMirrors(self.clock)
        self.trigger = TriggerLine(80_000.0)
        self.interlock = InterlockChain()
        self.source = Ramp()
        self.helios_firmware = HeliosFirmware(self.clock, self.mirrors, name="Helios 123")
        self.bridge_firmware = SamplingBridgeFirmware(
            self.clock, self.trigger, self.interlock, self.source, version=version
        )
        self.backend = SimUsbBackend(self.clock, [self.helios_firmware, self.bridge_firmware])
        self.helios = Helios(helios_link(self.clock, self.backend))
        self.bridge = SamplingBridge(bridge_link(self.clock, backend=self.backend))

    def beat(self) -> None:
        """Start the heartbeats as the controller does."""
        self.bridge.heartbeat()
        self.clock.every(self.bridge.watchdog_s / 4, self.bridge.heartbeat)


@pytest.fixture(params=[sbp.VERSION_1_0, sbp.VERSION_1_1], ids=["SBP1.0", "SBP1.1"])
def bench(request: pytest.FixtureRequest) -> Iterator[UsbBench]:
    """Give a bench with a bridge of either version."""
    made = UsbBench(request.param)
    yield made
    made.bridge.close()
    made.helios.close()


@pytest.fixture
def bench_1_0() -> UsbBench:
    """Give a bench with a bridge of version 1.0."""
    return UsbBench(sbp.VERSION_1_0)


@pytest.fixture
def bench_1_1() -> UsbBench:
    """Give a bench with a bridge of version 1.1."""
    return UsbBench(sbp.VERSION_1_1)


@pytest.fixture(scope="session")
def make_bench() -> type[UsbBench]:
    """Give the maker of benches, for tests that need a new one for each example."""
    return UsbBench


@pytest.fixture(scope="session")
def golden() -> dict[str, bytes]:
    """Give the worked bytes of the sampling bridge."""
    return {k: bytes.fromhex(v) for k, v in tomllib.loads((GOLDEN / "sampling_bridge.toml").read_text()).items()}


@pytest.fixture(scope="session")
def sdk_trace() -> list[tuple[str, int, bytes]]:
    """Give the trace of the Helios SDK: direction, endpoint, bytes."""
    steps: list[list[Any]] = tomllib.loads((GOLDEN / "helios.toml").read_text())["steps"]
    return [(way, endpoint, bytes.fromhex(data)) for way, endpoint, data in steps]
