"""Transcripts of whole benches, and their replay as devices."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.errors import DeviceFault
from picoradar.drivers.interfaces import SweepSettings
from picoradar.drivers.links import Transcript, read_transcript
from picoradar.instrument.bench import DeviceMaker, Finding, examine, make_bench
from picoradar.instrument.cli.main import run
from picoradar.instrument.controller import Controller
from picoradar.instrument.settings import Links, Settings, override
from picoradar.sim import SimulatedBench
from picoradar.sim.replay import ReplayedBench, ReplayMismatch
from tests.system.conftest import Radar

SWEEP = SweepSettings(start_ps=6500, step_ps=6.7, samples=200, averages=1, settle_shots=16, prf_hz=80_000)


def links(replayed: ReplayedBench) -> Links:
    urls = replayed.urls
    return Links(dg645=urls["DG645"], genesys=urls["Genesys"], tec=urls["TEC"])


def examined(make: DeviceMaker) -> list[tuple[str, str]]:
    def told(finding: Finding) -> tuple[str, str]:
        return finding.identity, finding.problem

    return [told(finding) for finding in examine(Settings(), make)]


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    path = tmp_path / "doctor.jsonl"
    assert run(["doctor", "--json", "--transcript", str(path)]) == 0
    return path


def test_a_transcript_holds_every_byte_with_its_time(recorded: Path) -> None:
    events = read_transcript(recorded)
    assert {e.link for e in events} == {"DG645", "Genesys", "TEC", "Helios DAC", "sampling bridge"}
    times = [e.time_s for e in events]
    assert times == sorted(times)
    dg645 = [e for e in events if e.link == "DG645"]
    assert [dg645[0].what, dg645[-1].what] == ["open", "close"]
    assert any(e.what == "write" and e.data == b"*IDN?\n" for e in dg645)
    assert any(e.what == "read" and e.data.startswith(b"Stanford") for e in dg645)


def test_an_existing_file_is_not_written_over(recorded: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = recorded.read_bytes()
    assert run(["doctor", "--transcript", str(recorded)]) == 2
    assert "will not be written over" in capsys.readouterr().err
    assert recorded.read_bytes() == before


def test_the_replay_of_a_session_gives_the_same_session(recorded: Path) -> None:
    with SimulatedBench() as bench:
        real = examined(DeviceMaker(Links(**bench.urls), bench.clock, bench.usb_backend))
    with ReplayedBench(recorded) as replayed:
        assert examined(DeviceMaker(links(replayed), replayed.clock, replayed.usb_backend)) == real
        assert replayed.finished


def test_the_replay_of_a_record_gives_the_same_record(tmp_path: Path) -> None:
    path = tmp_path / "record.jsonl"
    with SimulatedBench(target="plate") as bench, Transcript(path) as transcript:
        sampler = DeviceMaker(Links(), bench.clock, bench.usb_backend, transcript).bridge()
        sampler.open()
        sampler.configure(SWEEP)
        bench.trigger.rate_hz = 80_000
        (real,) = sampler.take(run_id=7)
        sampler.close()
    with ReplayedBench(path) as replayed:
        sampler = DeviceMaker(Links(), replayed.clock, replayed.usb_backend).bridge()
        sampler.open()
        sampler.configure(SWEEP)
        (again,) = sampler.take(run_id=7)
        sampler.close()
        assert replayed.finished
    assert again.run_id == 7
    assert again.sums.tolist() == real.sums.tolist()


@pytest.mark.parametrize("mode", ["sweep", "window"])
def test_the_replay_of_a_scan_gives_the_same_points(mode: str, tmp_path: Path) -> None:
    path = tmp_path / "scan.jsonl"
    radar = Radar(override(Settings(), {"scan": {"rows": 3, "columns": 12, "mode": mode}}), tmp_path)
    with Transcript(path) as transcript:
        radar.bench = make_bench(Links(**radar.sim.urls), radar.clock, radar.sim.usb_backend, transcript)
        points = scanned(radar)
    radar.sim.close()
    assert '"ahead": true' in path.read_text()  # answers of the second barrier, which are not waited for
    with ReplayedBench(path) as replayed:
        radar.clock, radar.bench = replayed.clock, make_bench(links(replayed), replayed.clock, replayed.usb_backend)
        assert scanned(radar) == points
        assert replayed.finished


def scanned(radar: Radar) -> bytes:
    radar.controller = Controller(radar.bench, radar.settings)
    radar.get_ready()
    assert radar.scan().stop_reason == "complete"
    radar.controller.shut_down()
    with radar.last_recording() as recording:
        return recording.cloud().points_mm.tobytes()


def test_a_refusal_is_replayed_as_a_refusal(tmp_path: Path) -> None:
    path = tmp_path / "refusal.jsonl"
    with SimulatedBench(target="plate") as bench, Transcript(path) as transcript:
        sampler = DeviceMaker(Links(), bench.clock, bench.usb_backend, transcript).bridge()
        sampler.open()
        with pytest.raises(DeviceFault) as real:
            sampler.gate_on()
        sampler.close()
    with ReplayedBench(path) as replayed:
        sampler = DeviceMaker(Links(), replayed.clock, replayed.usb_backend).bridge()
        sampler.open()
        with pytest.raises(DeviceFault) as again:
            sampler.gate_on()
        sampler.close()
    assert str(again.value) == str(real.value)


def test_a_host_that_does_something_else_is_told_what_the_transcript_has(recorded: Path) -> None:
    with ReplayedBench(recorded) as replayed:
        generator = DeviceMaker(links(replayed), replayed.clock).dg645()
        generator.open()
        with pytest.raises(ReplayMismatch, match=r"the transcript has write b'\*IDN\?\\n'.*TRAT"):
            generator.trigger_rate_hz = 80_000.0


def test_a_transcript_that_was_cut_off_can_be_read(recorded: Path) -> None:
    whole = read_transcript(recorded)
    recorded.write_bytes(recorded.read_bytes()[:-5])
    assert read_transcript(recorded) == whole[:-1]


@pytest.mark.parametrize("text", ["", "{}\n", '{"transcript": "picoradar", "version": 2}\n', "no JSON\n"])
def test_other_files_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other"
    path.write_text(text)
    with pytest.raises(ValueError, match="other"):
        read_transcript(path)


def test_a_damaged_line_is_refused_with_its_number(recorded: Path) -> None:
    lines = recorded.read_text().splitlines(keepends=True)
    lines[3] = json.dumps({"time_s": 1, "link": "DG645", "what": "read", "data": "xyz"}) + "\n"
    recorded.write_text("".join(lines))
    with pytest.raises(ValueError, match="line 4"):
        read_transcript(recorded)


def test_a_link_that_has_no_transcript_writes_none(tmp_path: Path) -> None:
    with SimulatedBench(target="plate", clock=VirtualClock()) as bench:
        generator = DeviceMaker(Links(**bench.urls), bench.clock, bench.usb_backend).dg645()
        generator.open()
        generator.close()
    assert list(tmp_path.iterdir()) == []
