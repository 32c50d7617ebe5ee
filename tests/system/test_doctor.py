"""The doctor on benches in which one thing is wrong: each has its line, with what to do."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.links import SerialLink
from picoradar.instrument.bench import DeviceMaker, Finding, examine
from picoradar.instrument.cli.main import run
from picoradar.instrument.settings import Links, Settings
from picoradar.sim import SimulatedBench
from picoradar.sim.ports import SerialWire, publish, withdraw


@pytest.fixture
def bench() -> Iterator[SimulatedBench]:
    with SimulatedBench(target="plate") as made:
        yield made


def findings(
    bench: SimulatedBench, settings: Settings | None = None, *, acknowledge: bool = False, **links: object
) -> dict[str, Finding]:
    make = DeviceMaker(Links(**{**bench.urls, **links}), bench.clock, bench.usb_backend)
    return {f.name: f for f in examine(settings or Settings(), make, acknowledge=acknowledge)}


def wrong(found: dict[str, Finding]) -> dict[str, str]:
    return {name: finding.problem for name, finding in found.items() if not finding.ok}


def test_a_bench_in_order(bench: SimulatedBench) -> None:
    found = findings(bench)
    assert wrong(found) == {}
    assert found["genesys"].identity.startswith("GEN600-1.3, s/n 0123456")
    assert not bench.bridge.gate_open
    assert bench.trigger.rate_hz == 0
    assert bench.genesys.output_v() < 1


def test_a_port_that_is_not_there(bench: SimulatedBench, tmp_path: Path) -> None:
    problems = wrong(findings(bench, dg645=str(tmp_path / "ttyUSB7")))
    assert list(problems) == ["dg645"]
    assert "check the name in the settings" in problems["dg645"]


def test_a_port_that_the_settings_do_not_name(bench: SimulatedBench) -> None:
    assert wrong(findings(bench, tec="")) == {
        "tec": "settings: links.tec is empty; give the port or URL of that device"
    }


@pytest.mark.skipif(os.name != "posix", reason="ports have groups on POSIX systems only")
def test_a_port_that_this_account_may_not_open(
    bench: SimulatedBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = os.openpty()
    port = tmp_path / "ttyUSB0"
    port.symlink_to(os.ttyname(ends[1]))
    real = serial.serial_for_url

    def refuse(url: str, **settings: object) -> serial.SerialBase:
        if url == str(port):
            raise serial.SerialException(errno.EACCES, f"could not open port {url}: Permission denied")
        return real(url, **settings)

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    problem = wrong(findings(bench, genesys=str(port)))["genesys"]
    assert f"not in its group {port.group()!r}" in problem
    for end in ends:
        os.close(end)
    assert "usermod" in problem


def test_a_port_that_another_program_has_open(bench: SimulatedBench) -> None:
    other = SerialLink(bench.urls["tec"], bench.clock, device="other program", baud=57600)
    other.open()
    problem = wrong(findings(bench))["tec"]
    other.close()
    assert "another program has it open" in problem


def test_two_ports_exchanged(bench: SimulatedBench) -> None:
    problems = wrong(findings(bench, dg645=bench.urls["tec"], tec=bench.urls["dg645"]))
    assert "a tec answers on this port: links.dg645 and links.tec seem to be swapped" in problems["dg645"]
    assert "a dg645 answers on this port: links.tec and links.dg645 seem to be swapped" in problems["tec"]


class Mute:
    """A device that is switched off."""

    baud = 9600

    def connect(self, send: object) -> None:
        """Never answers."""

    def receive(self, data: bytes) -> None:
        """Never hears."""


def test_nobody_answers(bench: SimulatedBench) -> None:
    url = publish("mute", "genesys", SerialWire(Mute(), bench.clock))
    problem = wrong(findings(bench, genesys=url))["genesys"]
    withdraw(url)
    assert "no answer" in problem
    assert "check power, cable and baud rate" in problem


def test_the_interlock_is_open(bench: SimulatedBench) -> None:
    bench.interlock.closed = False
    problems = wrong(findings(bench))
    assert {"genesys", "bridge"} <= problems.keys()
    assert all("close lid and key switch" in problem for problem in problems.values())


def test_a_locked_gate_is_told_and_unlocked_when_acknowledged(bench: SimulatedBench) -> None:
    bench.interlock.closed = False
    bench.interlock.closed = True
    assert "--acknowledge" in wrong(findings(bench))["bridge"]
    assert wrong(findings(bench, acknowledge=True)) == {}
    assert wrong(findings(bench)) == {}


def test_an_error_of_the_temperature_controller(bench: SimulatedBench) -> None:
    tec = DeviceMaker(Links(**bench.urls), bench.clock, bench.usb_backend).tec()
    tec.open()
    tec.emergency_stop()
    tec.link.close()
    problem = wrong(findings(bench))["tec"]
    assert "error 11: emergency stop" in problem
    assert "--acknowledge" in problem
    assert wrong(findings(bench, acknowledge=True)) == {}


def test_thresholds_that_the_target_would_trip(bench: SimulatedBench) -> None:
    tec = DeviceMaker(Links(**bench.urls), bench.clock, bench.usb_backend).tec()
    tec.open()
    tec.upper_threshold_degc = 22.0
    tec.close()
    assert "22 degC, the target is 23 degC" in wrong(findings(bench))["tec"]


def test_a_sweep_that_the_bridge_cannot_take(bench: SimulatedBench) -> None:
    settings = Settings.model_validate({"sampler": {"step_ps": 6.70005}})
    assert "cannot sample as the settings ask" in wrong(findings(bench, settings))["bridge"]


def test_a_usb_device_that_is_not_plugged_in(bench: SimulatedBench) -> None:
    (helios,) = (d for d in bench.usb_backend.enumerate_devices() if d.descriptors.idProduct == 0xE500)
    bench.usb_backend.unplug(helios.firmware)
    problems = wrong(findings(bench))
    assert list(problems) == ["helios"]
    assert "plug it in" in problems["helios"]


def test_the_command_without_settings_examines_the_simulated_bench(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["ok"] is True
    assert len(told["devices"]) == 5


def test_the_command_shows_people_one_line_a_device(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor"]) == 0
    out = capsys.readouterr().out
    assert len(out.splitlines()) == 5
    assert "DG645, s/n 001013" in out


def test_exit_status_3_and_the_reason_when_something_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = tmp_path / "bench.toml"
    settings.write_text(
        'bench = "devices"\n[links]\ndg645 = "/dev/not-there"\n'
        'usb_backend = "picoradar.sim.usb.forward:backend"\nusb_address = "127.0.0.1:9"\n'
    )
    assert run(["doctor", "--settings", str(settings), "--json"]) == 3
    told = json.loads(capsys.readouterr().out)
    assert told["ok"] is False
    assert [d["identity"] for d in told["devices"]] == [None] * 5
    assert all(d["problem"] for d in told["devices"])


def test_a_clock_of_its_own_is_not_needed(bench: SimulatedBench) -> None:
    assert isinstance(bench.clock, VirtualClock)
    began_s = bench.clock.now()
    findings(bench)
    assert bench.clock.now() - began_s < 10
