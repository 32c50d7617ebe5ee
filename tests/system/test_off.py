"""`picoradar off` and what a bench was found doing, after a program that was killed under light."""

from __future__ import annotations

import json
from typing import Any

import pytest

from picoradar.drivers.clock import VirtualClock
from picoradar.instrument.acquisition import Setup, raster_scan
from picoradar.instrument.bench import Bench, make_bench
from picoradar.instrument.cli.main import run
from picoradar.instrument.cli.session import calibration_of
from picoradar.instrument.controller import Controller, switch_off
from picoradar.instrument.settings import Links, Settings
from picoradar.sim import SimulatedBench
from picoradar.sim.faults import Fault, arm


@pytest.fixture
def left_on() -> tuple[SimulatedBench, Bench]:
    """A bench that a program has left that was killed under light, just now."""
    sim = SimulatedBench({"target": "plate"}, seed=1, clock=VirtualClock())
    links = Links(**sim.urls)
    killed = make_bench(links, sim.clock, sim.usb_backend)
    killed.sampler.open()
    killed.pulser.open()
    killed.pulser.configure(prf_hz=80e3, drive_v=290.0)
    raster_scan(Setup(Settings(), calibration_of(Settings()), sim.clock)).configure(killed.sampler)
    killed.sampler.heartbeat()
    killed.pulser.on()
    killed.sampler.gate_on()
    for link in (killed.pulser.generator.link, killed.pulser.supply.link, killed.sampler.link):  # type: ignore[attr-defined]
        link.close()  # as the operating system does for a killed program: nothing is sent any more
    assert sim.trigger.rate_hz == 80e3
    assert sim.genesys.output_v() > 280.0
    return sim, make_bench(links, sim.clock, sim.usb_backend)


@pytest.mark.parametrize("wait_s", [0.0, 2.0])
def test_off_ends_what_a_killed_program_has_left(left_on: tuple[SimulatedBench, Bench], wait_s: float) -> None:
    sim, bench = left_on
    sim.clock.sleep(wait_s)
    found_on, safe = switch_off(bench)
    assert set(found_on) == {"triggers", "supply", *(["gate"] if wait_s < 1 else [])}  # it has a watchdog
    assert safe.complete
    assert set(safe.steps) == {"gate", "pulser", "run", "mirrors", "diode"}
    sim.clock.sleep(60.0)
    assert (sim.trigger.rate_hz, sim.genesys.output_v() < 1.0) == (0.0, True)


@pytest.mark.parametrize("link", ["dg645", "genesys"])
def test_off_switches_off_what_it_reaches_and_says_what_it_does_not(
    left_on: tuple[SimulatedBench, Bench], link: str
) -> None:
    sim, bench = left_on
    arm(sim, [Fault.model_validate({"kind": "unplugged", "link": link, "at": {"time_s": sim.clock.now()}})])
    sim.clock.sleep(0.1)
    _, safe = switch_off(bench)
    assert safe.laser_off_verified  # by the gate
    assert "cannot open the port" in safe.steps["pulser"]
    sim.clock.sleep(60.0)  # the half of the pulser that answers is off all the same
    assert (sim.trigger.rate_hz == 0.0) is (link == "genesys")
    assert (sim.genesys.output_v() < 1.0) is (link == "dg645")


def test_connect_names_what_was_on(left_on: tuple[SimulatedBench, Bench]) -> None:
    sim, bench = left_on
    sim.clock.sleep(2.0)
    controller = Controller(bench, Settings())
    controller.connect()
    assert set(bench.found_on()) == {"triggers", "supply"}
    assert sim.trigger.rate_hz == 0.0
    controller.shut_down()
    controller.connect()
    assert bench.found_on() == ()


def test_the_command_says_so_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["off", "--json"]) == 0
    result: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert result["laser_off_verified"] is True
    assert result["found_on"] == []
    assert result["steps"] == dict.fromkeys(("gate", "pulser", "run", "mirrors", "diode"), "verified")


def test_the_command_without_devices_exits_4(tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    settings = tmp_path / "bench.toml"
    serial = 'dg645 = "/dev/nothing1"\ngenesys = "/dev/nothing2"\ntec = "/dev/nothing3"\n'
    usb = 'usb_backend = "picoradar.sim.usb.forward:backend"\nusb_address = "127.0.0.1:1"\n'
    settings.write_text(f'bench = "devices"\n[links]\n{serial}{usb}', encoding="utf-8")
    assert run(["off", "--settings", str(settings), "--json"]) == 4
    result = json.loads(capsys.readouterr().out)
    assert result["laser_off_verified"] is False
    assert "/dev/nothing1" in result["steps"]["pulser"]
    assert "/dev/nothing2" in result["steps"]["pulser"]
    assert "127.0.0.1:1" in result["steps"]["gate"]
