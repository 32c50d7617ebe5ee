"""Faults as data: every kind is known, can be declared in a file, and ends safely while the laser is on."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.faults.cases import all_cases, selection
from benchmarks.faults.life import run as live
from picoradar.drivers.clock import VirtualClock
from picoradar.instrument.cli.main import run
from picoradar.instrument.controller import STATES
from picoradar.sim import SimulatedBench
from picoradar.sim.faults import KINDS, Fault, arm, load_scenario

CASES = list(selection())


@pytest.mark.parametrize("case", CASES, ids=[f"{case.kind}-{case.link}" for case in CASES])
def test_a_fault_while_the_laser_is_on_ends_safely_and_loses_nothing(case, tmp_path: Path) -> None:
    result = live(case, tmp_path)
    assert not result.defect, result.defect
    assert result.safe, f"{result.state}: {result.cause}"
    assert result.in_time, f"{result.fault_to_dark_s} s after the fault, {result.seen_to_dark_s} s after it was seen"
    assert result.lost == 0
    assert result.wrong == 0


def test_the_campaign_covers_what_is_promised() -> None:
    cases = list(all_cases())
    assert len({case.kind for case in cases}) >= 40
    assert {case.state for case in cases} == set(STATES)
    assert len(cases) == len({case.kind for case in cases}) * len(STATES) * 3
    assert {case.kind for case in CASES} == {case.kind for case in cases}


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_can_be_declared_on_each_of_its_links_and_at_every_sort_of_moment(kind: str, tmp_path: Path) -> None:
    moments = ({"time_s": 3.0}, {"command": 2}, {"pulse": 1000}, {"probability": 0.5})
    declared = [{"kind": kind, "link": link, "at": at} for link in KINDS[kind].links for at in moments]
    file = tmp_path / "faults.json"
    file.write_text(json.dumps({"fault": declared}), encoding="utf-8")
    faults = load_scenario(file)
    assert [fault.as_dict() for fault in faults] == [{**entry, "parameters": {}} for entry in declared]
    with SimulatedBench({"target": "plate"}, clock=VirtualClock()) as bench:
        arm(bench, faults)
        bench.clock.sleep(5.0)  # what is due by time alone happens


def test_a_fault_ends_when_its_time_is_over() -> None:
    with SimulatedBench({"target": "plate"}, clock=VirtualClock()) as bench:
        arm(bench, [Fault(kind="interlock_opened", at={"time_s": 1.0}, lasts_s=2.0)])
        closed = []
        for _ in range(5):
            closed.append(bench.interlock.closed)
            bench.clock.sleep(0.9)
        assert closed == [True, True, False, False, True]


def test_the_same_seed_gives_the_same_faults() -> None:
    def answers(seed: int) -> list[bytes]:
        with SimulatedBench({"target": "plate"}, seed=seed, clock=VirtualClock()) as bench:
            arm(bench, [Fault(kind="reply_bit_flipped", link="dg645", at={"probability": 0.5})])
            wire, heard = bench.wires["dg645"], []
            wire.host_open = True
            for _ in range(12):
                wire.write(b"*IDN?\n")
                heard.append(wire.read(200, 0.1))
            return heard

    assert answers(1) == answers(1)
    assert answers(1) != answers(2)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[[fault]]\nkind = 'gremlins'\nat = {time_s = 1.0}", "fault 1: kind 'gremlins' is not known"),
        ("[[fault]]\nkind = 'reply_lost'\nlink = 'bridge'\nat = {time_s = 1.0}", "happens on dg645"),
        ("[[fault]]\nkind = 'reply_lost'\nlink = 'tec'\nat = {time_s = 1.0, command = 3}", "exactly one"),
        ("[[fault]]\nkind = 'reply_lost'\nlink = 'tec'\nat = {}", "exactly one"),
        ("[[fault]]\nkind = 'misfire'\nat = {time_s = 1.0}\nparameters = {shar = 0.1}", "no parameter shar"),
        ("[[fault]]\nkind = 'misfire'\nat = {time_s = -1.0}", "greater than or equal to 0"),
        ("[[fault]]\nkind = 'misfire'\nat = {time_s = 1.0}\nwhy = 'no'", "Extra inputs"),
        ("fault = 3", "holds no list"),
        ("[[fault", "cannot be read"),
        ("fault = " + "[" * 5000 + "]" * 5000, "nested too deeply"),
        ("[[fault]]\nkind = 'misfire'\nat = {pulse = 0x" + "f" * 30 + "}", "more than 64 bits"),
    ],
)
def test_a_scenario_that_cannot_be_is_refused(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "faults.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"faults\.toml"):
        load_scenario(file)
    assert run(["scan", "--grid", "2x2", "--faults", str(file), "-o", str(tmp_path / "scan.db")]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "scan.db").exists()
