"""The pulser: order of on and off, read-back, and what happens when a step fails."""

from __future__ import annotations

import pytest

from picoradar.drivers.dg645 import DG645
from picoradar.drivers.errors import DeviceFault, LimitError, LinkLost
from picoradar.drivers.genesys import Genesys
from picoradar.drivers.interfaces import Pulser as PulserInterface
from picoradar.drivers.pulser import Pulser
from picoradar.sim.firmware.dg645 import Dg645Firmware
from picoradar.sim.firmware.genesys import GenesysFirmware
from picoradar.sim.ports.wire import wire_at
from picoradar.sim.wires import InterlockChain, TriggerLine


class Bench:
    """Both devices on their lines; keeps the text that each was sent."""

    def __init__(self, clock, connect):
        self.trigger, self.interlock = TriggerLine(), InterlockChain()
        self.supply_firmware = GenesysFirmware(clock, self.interlock)
        self.generator_link = connect(Dg645Firmware(clock, self.trigger, self.interlock))
        self.supply_link = connect(self.supply_firmware)
        self.sent = []
        for link in (self.generator_link, self.supply_link):
            self._listen(link)
        self.pulser = Pulser(DG645(self.generator_link), Genesys(self.supply_link), clock)

    def _listen(self, link):
        write = link.write

        def listening(data):
            self.sent.append(data.decode().strip())
            write(data)

        link.write = listening


@pytest.fixture
def bench(clock, connect):
    bench = Bench(clock, connect)
    bench.pulser.open()
    bench.pulser.configure(prf_hz=80e3, drive_v=290)
    bench.sent.clear()
    return bench


def test_satisfies_the_interface(bench):
    pulser: PulserInterface = bench.pulser
    assert str(pulser.identify()) == "DG645 + GEN600-1.3, s/n 001013 + 0123456, ver1.02.0A + 1U-4.3"


def test_on_is_supply_first(bench):
    bench.pulser.on()
    steps = [text for text in bench.sent if text not in ("LERR?", "MV?")]
    assert steps == ["OUT 1", "OUT?", "PV?", "TSRC 0", "TSRC?"]
    assert bench.sent.index("MV?") < bench.sent.index("TSRC 0")
    assert bench.trigger.rate_hz == 80e3
    status = bench.pulser.status()
    assert (status.triggers_on, status.output_on, status.interlock_closed) == (True, True, True)
    assert (status.prf_hz, status.drive_v, status.problem) == (80e3, 290, "")
    assert status.measured_v == pytest.approx(290, rel=0.01)


def test_off_is_triggers_first(bench):
    bench.pulser.on()
    bench.sent.clear()
    bench.pulser.off()
    assert [text for text in bench.sent if text != "LERR?"] == ["TSRC 5", "TSRC?", "OUT 0", "OUT?"]
    assert bench.trigger.rate_hz == 0
    status = bench.pulser.status()
    assert (status.triggers_on, status.output_on) == (False, False)


def test_supply_goes_off_even_if_the_generator_has_gone(bench, clock):
    bench.pulser.on()
    wire_at(bench.generator_link.url).plugged = False
    with pytest.raises(LinkLost):
        bench.pulser.off()
    clock.sleep(2)
    assert bench.supply_firmware.output_v() < 60


def test_triggers_stop_even_if_the_supply_has_gone(bench):
    bench.pulser.on()
    wire_at(bench.supply_link.url).plugged = False
    with pytest.raises(LinkLost):
        bench.pulser.off()
    assert bench.trigger.rate_hz == 0


def test_no_triggers_with_the_interlock_open(bench):
    bench.interlock.closed = False
    with pytest.raises(DeviceFault, match="E07"):
        bench.pulser.on()
    assert "TSRC 0" not in bench.sent
    status = bench.pulser.status()
    assert (status.triggers_on, status.output_on, status.interlock_closed) == (False, False, False)
    assert "supply fault 80: INTERLOCK" in status.problem


def test_no_triggers_when_the_voltage_does_not_come(bench):
    bench.pulser.supply.current_a = 0.005
    with pytest.raises(DeviceFault, match=r"output is 117 V, not 290 V, 5 s after"):
        bench.pulser.on()
    assert "TSRC 0" not in bench.sent
    assert not bench.pulser.status().output_on


def test_interlock_during_emission(bench, clock):
    bench.pulser.on()
    bench.interlock.closed = False
    assert bench.trigger.rate_hz == 0
    clock.sleep(0.1)
    status = bench.pulser.status()
    assert not status.output_on
    assert status.problem.startswith("triggers were inhibited; supply fault 80")


@pytest.mark.parametrize(("prf_hz", "drive_v"), [(19e3, 290), (241e3, 290), (80e3, 239), (80e3, 331)])
def test_nothing_is_sent_out_of_range(bench, prf_hz, drive_v):
    with pytest.raises(LimitError):
        bench.pulser.configure(prf_hz=prf_hz, drive_v=drive_v)
    assert bench.sent == []


@pytest.mark.parametrize(("prf_hz", "drive_v"), [(20e3, 240), (240e3, 330)])
def test_ends_of_the_ranges(bench, prf_hz, drive_v):
    bench.pulser.configure(prf_hz=prf_hz, drive_v=drive_v)
    bench.pulser.on()
    assert bench.trigger.rate_hz == prf_hz


def test_cycle_must_fit_in_the_period(bench):
    bench.pulser.pulse_width_s = 12.5e-6
    with pytest.raises(LimitError, match="does not fit in a period"):
        bench.pulser.configure(prf_hz=80e3, drive_v=290)
    assert bench.sent == []


def test_closing_leaves_all_off(bench, clock):
    bench.pulser.on()
    bench.pulser.close()
    bench.pulser.close()
    assert bench.trigger.rate_hz == 0
    clock.sleep(2)
    assert bench.supply_firmware.output_v() < 60
