"""Another maker's temperature controller is one line in the settings: the TC200 keeps the diode warm during a scan."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from picoradar.drivers.tc200 import TC200
from picoradar.instrument.bench import DeviceMaker, Finding, examine, make_bench
from picoradar.instrument.cli.commands.sim import host_settings
from picoradar.instrument.cli.main import run
from picoradar.instrument.controller import Controller
from picoradar.instrument.settings import Links, Settings
from picoradar.sim import SimulatedBench
from picoradar.sim.faults import Fault, arm

SETTINGS = """
[links]
temperature = "tc200"
[scan]
rows = 3
columns = 3
"""


@pytest.fixture
def bench() -> Iterator[SimulatedBench]:
    with SimulatedBench({"temperature_controller": "tc200"}, target="plate") as made:
        yield made


def findings(bench: SimulatedBench, settings: Settings | None = None, **links: object) -> dict[str, Finding]:
    make = DeviceMaker(
        Links(temperature="tc200", **{**bench.urls, **links}),
        bench.clock,
        bench.usb_backend,
    )
    return {f.name: f for f in examine(settings or Settings(), make)}


def test_a_scan_with_the_tc200(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "heater.toml").write_text(SETTINGS)
    path = tmp_path / "scan.db"
    options = ["--settings", str(tmp_path / "heater.toml"), "--target", "plate", "-o", str(path), "--json"]
    assert run(["scan", *options]) == 0, capsys.readouterr().err
    result = json.loads(capsys.readouterr().out)
    assert (result["points"], result["laser_off_verified"], result["stop_reason"]) == (9, True, "complete")
    assert result["truth"]["range_rms_mm"] < 0.5
    assert run(["info", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["scanner"]["diode"].startswith("TC200")


def test_the_heater_warms_the_diode_and_is_off_at_the_end(bench: SimulatedBench) -> None:
    links = Links(temperature="tc200", **bench.urls)
    settings = Settings(links=links)
    devices = make_bench(links, bench.clock, bench.usb_backend)
    assert isinstance(devices.diode, TC200)
    controller = Controller(devices, settings)
    controller.connect()
    cold = bench.block.temperature_degc()
    controller.warm_up(lambda _: None)
    assert cold < 21
    assert bench.block.temperature_degc() == pytest.approx(23.0, abs=0.25)
    assert devices.diode.status().regulating
    controller.shut_down()
    bench.clock.sleep(600.0)
    assert bench.block.temperature_degc() == pytest.approx(cold, abs=0.5)


def test_the_doctor_examines_the_controller_of_the_settings(bench: SimulatedBench) -> None:
    found = findings(bench)
    assert list(found) == ["dg645", "genesys", "tc200", "helios", "bridge"]
    assert all(finding.ok for finding in found.values())
    assert found["tc200"].identity.startswith("TC200")


def test_the_doctor_says_what_a_heater_cannot_do(bench: SimulatedBench) -> None:
    cooler = Settings.model_validate({"diode": {"target_degc": 20.0}})
    problem = findings(bench, cooler)["tc200"].problem
    assert "20.5 degC, the target is 20 degC: it can only heat" in problem
    low = TC200(DeviceMaker(Links(temperature="tc200", **bench.urls), bench.clock).tc200().link)
    low.open()
    low.largest_degc = 21.0
    low.close()
    assert "largest temperature is 21 degC" in findings(bench)["tc200"].problem


def test_the_doctor_finds_the_controller_on_another_port(bench: SimulatedBench) -> None:
    problem = findings(bench, tc200=bench.urls["dg645"])["tc200"].problem
    assert "a dg645 answers on this port: links.tc200 and links.dg645 seem to be swapped" in problem


def test_a_missing_port_is_named(bench: SimulatedBench) -> None:
    assert findings(bench, tc200="")["tc200"].problem.startswith("settings: links.tc200 is empty")


def test_a_served_bench_tells_its_host_which_controller_it_has(tmp_path: Path) -> None:
    serial = {"tc200": {"pty": None, "socket": "socket://127.0.0.1:1"}}
    usb = {"backend": "picoradar.sim.usb.forward:backend", "address": "127.0.0.1:2"}
    settings = Settings.model_validate({"links": {"temperature": "tc200"}})
    made = host_settings(settings, {"serial": serial, "usb": usb}, 1.0, tmp_path)
    assert (made.links.temperature, made.links.tc200) == ("tc200", "socket://127.0.0.1:1")


def test_a_fault_on_the_controller_that_is_not_there_is_refused(bench: SimulatedBench) -> None:
    fault = Fault.model_validate({"kind": "silent", "link": "tec", "at": {"time_s": 1.0}})
    with pytest.raises(ValueError, match="tec is not on this bench, which has dg645, genesys, tc200"):
        arm(bench, [fault])
