"""Whatever happens to transfers: the drivers end in time, and never give damaged data as good."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.drivers.bridge import sbp
from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.errors import DeviceError
from picoradar.drivers.interfaces import Record, SweepSettings
from picoradar.drivers.links import Usbtmc
from picoradar.drivers.oscilloscope import Oscilloscope, oscilloscope_link
from picoradar.sim.firmware.oscilloscope import OscilloscopeFirmware
from picoradar.sim.usb import InTransfer, SimUsbBackend
from picoradar.sim.wires import TriggerLine

KINDS = st.sampled_from(
    ["good", "good", "lost", "flipped", "doubled", "split", "joined", "shortened", "lengthened", "stalled"]
)
DAMAGE = st.lists(st.tuples(KINDS, st.integers(0, 1 << 30)), max_size=12)
SWEEP = SweepSettings(5000.0, 6.7, 3000, 2, 16, 80_000.0)  # two frames a record


class Damage:
    """Does to each transfer of an endpoint what a list says; after its end all are good."""

    def __init__(self, device: Any, endpoint: int, plan: Iterable[tuple[str, int]]) -> None:
        self._device = device
        self._endpoint = endpoint
        self._plan = iter(plan)
        device.tamper = self._tamper

    def _tamper(self, endpoint: int, data: bytes) -> list[InTransfer]:
        kind, where = next(self._plan, ("good", 0)) if endpoint == self._endpoint else ("good", 0)
        at = where % len(data) if data else 0
        match kind:
            case "lost":
                return []
            case "flipped" if data:
                return [InTransfer(data[:at] + bytes([data[at] ^ (1 << where % 8)]) + data[at + 1 :])]
            case "doubled":
                return [InTransfer(data), InTransfer(data)]
            case "split":
                return [InTransfer(data[:at]), InTransfer(data[at:])]
            case "joined":
                return [InTransfer(data, ended=False)]
            case "shortened":
                return [InTransfer(data[:at] + data[at + 1 + where % 7 :])]
            case "lengthened":
                return [InTransfer(data[:at] + b"SLRF\x01" + data[at:])]
            case "stalled":
                self._device.halted.add(endpoint)
        return [InTransfer(data)]


def _is_measured(record: Record, number: int) -> bool:
    """Whether a record is what the source of the test gives in some repetition of the run."""
    codes = record.sums // 2
    repeat_shift = (int(codes[0]) - 3 * number) % 200
    return (
        repeat_shift % 7 == 0
        and record.sums.tolist() == (((np.arange(3000) + repeat_shift + 3 * number) % 200) * 2).tolist()
    )


@given(plan=DAMAGE, records=st.integers(1, 3))
@settings(deadline=None, max_examples=60)
def test_bridge_gives_whole_records_or_an_error(make_bench: Any, plan: list[tuple[str, int]], records: int) -> None:
    bench = make_bench(sbp.VERSION_1_1)
    bench.bridge.open()
    bench.bridge.configure(SWEEP)
    Damage(bench.backend.device_of(bench.bridge_firmware), sbp.EP_DATA, plan)
    begin = bench.clock.now()
    got: list[Record] = []
    with contextlib.suppress(DeviceError):
        got = bench.bridge.take(3, records)
        assert [r.number for r in got] == list(range(records))
    assert all(_is_measured(r, r.number) for r in got)
    assert bench.clock.now() - begin < 3 * (records * SWEEP.record_s + 3 * SWEEP.record_s + 0.6)
    bench.backend.device_of(bench.bridge_firmware).tamper = None
    bench.bridge.link.clear_halt(sbp.EP_DATA)
    bench.bridge.stop()
    assert _is_measured(bench.bridge.take(4)[0], 0)
    bench.bridge.close()


@given(plan=DAMAGE)
@settings(deadline=None, max_examples=40)
def test_galvo_answers_or_tells(make_bench: Any, plan: list[tuple[str, int]]) -> None:
    bench = make_bench(sbp.VERSION_1_0)
    bench.helios.open()
    device = bench.backend.device_of(bench.helios_firmware)
    Damage(device, 0x83, plan)
    for code in range(6):
        begin = bench.clock.now()
        with contextlib.suppress(DeviceError):
            bench.helios.move(code, code)
        assert bench.clock.now() - begin < 1.2
    device.tamper = None
    with contextlib.suppress(DeviceError):
        bench.helios.link.clear_halt(0x83)
    bench.helios.close()
    bench.helios.open()
    bench.helios.move(7, 7)
    bench.clock.sleep(0.1)
    assert bench.mirrors.seen[-1][1:] == ((7 - 2048) / 2048, (7 - 2048) / 2048)
    bench.helios.close()


class Steps:
    clipped = False

    def acquire(self, wanted: Any) -> Any:
        return (np.arange(wanted.samples, dtype=np.uint32) % 100 + 60) * wanted.sweeps


@given(plan=DAMAGE)
@settings(deadline=None, max_examples=40)
def test_oscilloscope_ends_in_time_and_comes_back(plan: list[tuple[str, int]]) -> None:
    clock = VirtualClock()
    firmware = OscilloscopeFirmware(clock, TriggerLine(20_000.0), Steps())
    backend = SimUsbBackend(clock, [firmware])
    scope = Oscilloscope(Usbtmc(oscilloscope_link(clock, backend=backend)))
    scope.open()
    scope.configure(SweepSettings(2000.0, 5.0, 200, 4, 0, 20_000.0))
    device = backend.device_of(firmware)
    Damage(device, 0x81, plan)
    for _ in range(3):
        begin = clock.now()
        with contextlib.suppress(DeviceError):
            assert len(scope.take(1)[0].sums) == 200
        assert clock.now() - begin < 30.0
    device.tamper = None
    scope.tmc.link.clear_halt(0x81)
    scope.stop()
    (record,) = scope.take(2)
    assert record.trace_mv[:3] == pytest.approx([14.0, 14.5, 15.0], abs=0.01)
    scope.close()
