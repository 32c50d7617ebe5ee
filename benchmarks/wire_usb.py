"""Speed of the USB wire: frames decoded per second, and the host time of transfers over the simulated bus.

Run as ``python benchmarks/wire_usb.py``; it uses one core. Each figure is the best of several rounds, so that other
load on the computer counts as little as it can.
"""

from __future__ import annotations

import sys
import time
import timeit
from array import array
from collections.abc import Callable
from pathlib import Path

import numpy as np
import usb.core
import usb.util

sys.path.insert(0, str(Path(__file__).parents[1]))

from picoradar.drivers.bridge.sbp import Frame, FrameFlag, FrameParser, encode_frame
from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.links import UsbIdentity, UsbLink
from picoradar.sim.usb import BULK, Configuration, Device, Endpoint, Interface, Setup, SimUsbBackend

ROUNDS = 7
BLOCK = 16_384
ROOM = BLOCK + 512  # takes the zero-length packet at the end as well


class Source:
    """A device that takes everything and always has a full block to send."""

    descriptors = Device(
        0x1234, 0x5678, 0x0100, (Configuration((Interface((Endpoint(0x01, BULK, 512), Endpoint(0x81, BULK, 512))),)),)
    )
    block = bytes(BLOCK)

    def control(self, setup: Setup, data: bytes) -> bytes:  # noqa: ARG002
        return bytes(setup.length)

    def receive(self, endpoint: int, data: bytes) -> bool:  # noqa: ARG002
        return True

    def take(self, endpoint: int) -> bytes | None:  # noqa: ARG002
        return self.block

    def configured(self, value: int) -> None:
        """Nothing to do."""

    def alternate_selected(self, interface: int, alternate: int) -> None:
        """Nothing to do."""

    def halt_cleared(self, endpoint: int) -> None:
        """Nothing to do."""

    def bus_reset(self) -> None:
        """Nothing to do."""


def best(call: Callable[[], object], number: int) -> float:
    """Get the seconds of one call on the processor: the best mean of several rounds."""
    return min(timeit.repeat(call, number=number, repeat=ROUNDS, timer=time.process_time)) / number


def frames(samples: int, count: int) -> bytes:
    """Make a stream of whole frames of 16-bit sums."""
    rng = np.random.default_rng(1)
    return b"".join(
        encode_frame(
            Frame(1, FrameFlag.FIRST, k, 7, k, 0, 0, 8, 2300, 1, 0, rng.integers(0, 2040, samples).astype(np.uint16)),
            52,
        )
        for k in range(count)
    )


def decode_rate(samples: int, cut: int) -> float:
    """Get the megabytes of stream that are decoded in a second, from reads of ``cut`` bytes."""
    stream = frames(samples, 200)
    reads = [stream[k : k + cut] for k in range(0, len(stream), cut)]

    def decode() -> None:
        parser = FrameParser(4096)
        found = sum(len(parser.feed(data)) for data in reads)
        if found != 200:
            raise RuntimeError(f"{found} of 200 frames were found")

    return len(stream) / best(decode, 3) / 1e6


def main() -> None:
    """Measure and print the table."""
    print(f"{'frames decoded, one core':44}{'MB/s':>10}")
    for samples, cut, name in (
        (2048, BLOCK, "2048 samples a frame, reads of 16 KiB"),
        (1430, 52 + 2860 + 4, "1430 samples a frame, one frame a read"),
        (1430, BLOCK, "1430 samples a frame, reads of 16 KiB"),
        (1430, 512, "1430 samples a frame, reads of 512 bytes"),
        (96, BLOCK, "96 samples a frame (windows), reads of 16 KiB"),
    ):
        print(f"  {name:42}{decode_rate(samples, cut):10.0f}")

    clock = VirtualClock()
    backend = SimUsbBackend(clock, [Source()])
    print(f"{'host time of a transfer':44}{'us':>10}")
    device = usb.core.find(backend=backend)
    buffer = array("B", bytes(ROOM))
    show("bulk read of 16 KiB with pyusb alone", lambda: device.read(0x81, buffer, 1000))
    usb.util.dispose_resources(device)
    link = UsbLink(UsbIdentity(0x1234, 0x5678), clock, device="source", backend=backend)
    link.open()
    show("bulk read of 16 KiB", lambda: link.read(0x81, ROOM, timeout_s=1.0))
    show("bulk write of 64 bytes", lambda: link.write(0x01, bytes(64), timeout_s=1.0))
    show("control request of 32 bytes", lambda: link.control_in(3, 0, 32))
    link.close()


def show(name: str, call: Callable[[], object]) -> None:
    """Measure a transfer and print its line."""
    print(f"  {name:42}{best(call, 2000) * 1e6:10.1f}")


if __name__ == "__main__":
    main()
