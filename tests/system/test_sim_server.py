"""`picoradar sim` in a process of its own, used by other processes: doctor, scan, plain pyusb and pyserial."""

from __future__ import annotations

import importlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
import serial
import usb.core
import usb.util

from picoradar.instrument.cli.main import run

PICORADAR = [sys.executable, "-m", "picoradar.instrument.cli"]


def started(*options: str, before: Callable[[], None] | None = None) -> tuple[subprocess.Popen[str], dict[str, Any]]:
    command = [*PICORADAR, "sim", "--speed", "20", "--target", "plate", "--seed", "5", *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, preexec_fn=before)
    assert process.stdout is not None
    return process, json.loads(process.stdout.readline())


@contextmanager
def served(*options: str) -> Iterator[dict[str, Any]]:
    process, told = started(*options)
    assert process.stdout is not None
    yield told
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) == 0
    assert process.stdout.read() == "", "nothing but the first line may be on stdout"
    process.stdout.close()
    assert "--out" in options or not Path(told["settings"]).exists()


@pytest.fixture(scope="module")
def sim() -> Iterator[dict[str, Any]]:
    with served() as told:
        yield told


def over_ptys(told: dict[str, Any], folder: Path) -> Path:
    text = Path(told["settings"]).read_text()
    for ports in told["serial"].values():
        text = text.replace(ports["socket"], ports["pty"])
    path = folder / "ptys.toml"
    path.write_text(text)
    return path


def test_the_first_line_says_what_there_is(sim: dict[str, Any]) -> None:
    assert sim["ready"] is True
    assert sim["seed"] == 5
    assert {"dg645", "genesys", "tec"} <= sim["serial"].keys()
    for ports in sim["serial"].values():
        assert re.fullmatch(r"socket://127\.0\.0\.1:\d+", ports["socket"])
        assert (ports["pty"] is None) == (os.name != "posix")


def test_the_doctor_finds_every_device(sim: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor", "--settings", sim["settings"], "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["ok"] is True
    assert [d["name"] for d in told["devices"]] == ["dg645", "genesys", "tec", "helios", "bridge"]
    assert all(d["ok"] and d["identity"] and d["problem"] is None for d in told["devices"])


def accepted(told: dict[str, Any]) -> bool:
    return (told["points"], told["stop_reason"], told["laser_off_verified"]) == (16, "complete", True)


def test_a_scan_over_sockets(sim: dict[str, Any], tmp_path: Path) -> None:
    done = subprocess.run(
        [*PICORADAR, "scan", "--settings", sim["settings"], "--grid", "4x4", "-o", str(tmp_path / "scan.db"), "--json"],
        capture_output=True, text=True, check=False, timeout=55,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert accepted(json.loads(done.stdout))


@pytest.mark.skipif(os.name != "posix", reason="there are no ptys on this system")
def test_a_scan_over_ptys(sim: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings, recording = over_ptys(sim, tmp_path), tmp_path / "scan.db"
    assert run(["scan", "--settings", str(settings), "--grid", "4x4", "-o", str(recording), "--json"]) == 0
    assert accepted(json.loads(capsys.readouterr().out))


def test_pyusb_of_another_process_walks_all_descriptors(sim: dict[str, Any]) -> None:
    module, _, function = sim["usb"]["backend"].partition(":")
    backend = getattr(importlib.import_module(module), function)(sim["usb"]["address"])
    devices = {d.idProduct: d for d in usb.core.find(find_all=True, backend=backend, idVendor=0x1209)}
    helios, bridge = devices[0xE500], devices[0x0001]
    assert helios.product == "Helios Laser DAC"
    assert bridge.serial_number == "SB-0001"
    found = {e.bEndpointAddress for c in helios for i in c for e in i}
    assert found == {0x02, 0x81, 0x06, 0x83, 0x84, 0x05}
    assert usb.core.find(idProduct=0x1234, backend=backend) is None
    for device in devices.values():
        usb.util.dispose_resources(device)


def test_usb_of_another_process_behaves_as_a_bus(sim: dict[str, Any]) -> None:
    module, _, function = sim["usb"]["backend"].partition(":")
    backend = getattr(importlib.import_module(module), function)(sim["usb"]["address"])
    bridge = usb.core.find(idProduct=0x0001, backend=backend)
    with pytest.raises(usb.core.USBTimeoutError):
        bridge.read(0x81, 512, 50)
    with pytest.raises(usb.core.USBError) as stall:
        bridge.ctrl_transfer(0xC1, 0x7F, 0, 0, 16)
    assert stall.value.errno == 32
    other = usb.core.find(idProduct=0x0001, backend=backend)
    with pytest.raises(usb.core.USBError) as busy:
        usb.util.claim_interface(other, 0)
    assert busy.value.errno == 16
    usb.util.dispose_resources(bridge)
    usb.util.claim_interface(other, 0)
    usb.util.dispose_resources(other)


def test_two_hosts_at_once_do_not_wait_for_each_other(sim: dict[str, Any]) -> None:
    module, _, function = sim["usb"]["backend"].partition(":")
    backend = getattr(importlib.import_module(module), function)(sim["usb"]["address"])
    bridge = usb.core.find(idProduct=0x0001, backend=backend)
    late: list[bool] = []

    def wait_for_data() -> None:
        with pytest.raises(usb.core.USBTimeoutError):
            bridge.read(0x81, 512, 20_000)  # one second of the wall
        late.append(True)

    usb.util.claim_interface(bridge, 0)
    waiting = threading.Thread(target=wait_for_data)
    waiting.start()
    with serial.serial_for_url(sim["serial"]["dg645"]["socket"], timeout=2.0) as port:
        for _ in range(3):
            port.write(b"*IDN?\n")
            assert b"DG645" in port.read_until(b"\r\n")
            assert len(bridge.ctrl_transfer(0xC1, 3, 0, 0, 64)) == 32  # GET_STATUS, while the read waits
    assert not late
    waiting.join()
    usb.util.dispose_resources(bridge)


def test_a_speed_that_cannot_be_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for speed in ("max", "1000", "0", "fast"):
        assert run(["sim", "--speed", speed]) == 2
        assert "--speed" in capsys.readouterr().err


def test_a_host_that_comes_when_the_bench_has_gone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = tmp_path / "gone.toml"
    settings.write_text(
        'bench = "devices"\n[links]\ndg645 = "socket://127.0.0.1:9"\ngenesys = "socket://127.0.0.1:9"\n'
        'tec = "socket://127.0.0.1:9"\nusb_backend = "picoradar.sim.usb.forward:backend"\nusb_address = "127.0.0.1:9"\n'
    )
    assert run(["doctor", "--settings", str(settings), "--json"]) == 3
    told = json.loads(capsys.readouterr().out)
    assert told["ok"] is False
    for device in told["devices"]:
        assert "picoradar sim" in device["problem"]


def test_faults_show_at_the_served_ports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    faults = tmp_path / "faults.toml"
    faults.write_text(
        '[[fault]]\nkind = "unplugged"\nlink = "tec"\nat = {time_s = 0}\n'
        '[[fault]]\nkind = "usb_unplugged"\nlink = "helios"\nat = {time_s = 0}\n'
    )
    with served("--faults", str(faults)) as told:
        assert run(["doctor", "--settings", told["settings"], "--json"]) == 3
        assert told["serial"]["tec"]["pty"] is None or not Path(told["serial"]["tec"]["pty"]).exists()
    devices = {d["name"]: d for d in json.loads(capsys.readouterr().out)["devices"]}
    assert {name for name, device in devices.items() if not device["ok"]} == {"tec", "helios"}


def test_the_folder_of_a_bench_is_taken_only_after_its_death(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    process, told = started("--out", str(tmp_path))
    names = sorted(tmp_path.iterdir())
    text = Path(told["settings"]).read_text()
    assert run(["sim", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert f"another picoradar sim (process {process.pid}) serves there" in said
    assert "--out" in said
    assert (sorted(tmp_path.iterdir()), Path(told["settings"]).read_text()) == (names, text)
    process.kill()
    process.communicate()
    with served("--out", str(tmp_path)) as told, serial.serial_for_url(told["serial"]["dg645"]["socket"]) as port:
        port.timeout = 2.0
        port.write(b"*IDN?\n")
        assert b"DG645" in port.read_until(b"\r\n")
    assert {path.name for path in tmp_path.iterdir()} == {"settings.toml", "calibration.json"}


@pytest.mark.skipif(os.name != "posix", reason="the limit is set in the way of POSIX")
def test_a_bench_without_descriptors_goes_on_with_the_hosts_it_has(tmp_path: Path) -> None:
    import resource

    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    process, told = started(before=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (40, hard)))
    address, _, number = told["usb"]["address"].rpartition(":")
    with serial.serial_for_url(told["serial"]["dg645"]["socket"], timeout=2.0) as port, ExitStack() as hosts:
        for _ in range(60):
            hosts.enter_context(socket.create_connection((address, int(number)), timeout=5))
        port.write(b"*IDN?\n")
        assert b"DG645" in port.read_until(b"\r\n")
        hosts.close()
        backend = importlib.import_module("picoradar.sim.usb.forward").backend(told["usb"]["address"])
        assert backend.enumerate_devices()
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) == 0
    process.communicate()
