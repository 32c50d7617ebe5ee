"""Host time of one serial round trip in process: driver, pyserial, simulated line, firmware and back.

Run: ``python benchmarks/wire_serial.py``. The aim is under 50 us a round trip. Nothing waits in virtual time, so
processor time is counted: what else the computer does counts less.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import picoradar.sim.ports  # noqa: F401  (makes sim:// known to pyserial)
from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.dg645 import DG645
from picoradar.drivers.genesys import Genesys
from picoradar.drivers.links import SerialLink
from picoradar.drivers.mecom import Tec
from picoradar.sim.firmware.dg645 import Dg645Firmware
from picoradar.sim.firmware.genesys import GenesysFirmware
from picoradar.sim.firmware.mecom import TecFirmware
from picoradar.sim.ports import SerialFirmware, SerialWire, publish
from picoradar.sim.wires import InterlockChain, TriggerLine

ROUNDS = 40
CALLS = 200
AIM_US = 50.0


class Echo:
    """Sends back every line: the cost of link, line and clock alone."""

    baud = 115200

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        self._send = send

    def receive(self, data: bytes) -> None:
        self._send(data, 0.001)


class Block:
    """A diode block at a fixed temperature."""

    def temperature_degc(self) -> float:
        return 23.0

    def sink_degc(self) -> float:
        return 21.0

    def drive(self, current_a: float) -> None:
        pass


def best_us(call: Callable[[], object]) -> float:
    """Get the host time of one call in us, best of several rounds."""
    times = []
    for _ in range(ROUNDS):
        start = time.process_time()
        for _ in range(CALLS):
            call()
        times.append((time.process_time() - start) / CALLS * 1e6)
    return min(times)


def main() -> None:
    """Print one line for each device."""
    clock = VirtualClock()
    interlock = InterlockChain()

    def link(firmware: SerialFirmware, name: str) -> SerialLink:
        url = publish("benchmark", name, SerialWire(firmware, clock))
        return SerialLink(url, clock, device=name, baud=firmware.baud)

    echo = link(Echo(), "echo")
    echo.open()
    generator = DG645(link(Dg645Firmware(clock, TriggerLine(), interlock), "dg645"))
    supply = Genesys(link(GenesysFirmware(clock, interlock), "genesys"))
    tec = Tec(link(TecFirmware(clock, Block()), "tec"))
    for device in (generator, supply, tec):
        device.open()

    def echoed() -> bytes:
        echo.write(b"12345678\n")
        return echo.read_until(b"\n")

    cases: list[tuple[str, Callable[[], object]]] = [
        ("link, line and clock alone", echoed),
        ("DG645 TRAT?", lambda: generator.trigger_rate_hz),
        ("Genesys MV?", lambda: supply.measured_v),
        ("MeCom ?VR object temperature", lambda: tec.temperature_degc),
    ]
    for name, call in cases:
        took_us = best_us(call)
        print(f"{name:32s} {took_us:6.1f} us   {'within' if took_us < AIM_US else 'over'} {AIM_US:g} us")


if __name__ == "__main__":
    main()
