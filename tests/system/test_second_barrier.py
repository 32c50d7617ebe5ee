"""A serial link that is lost under light is seen within a second of the clock, in every mode, and costs no time."""

from __future__ import annotations

from typing import Any

import pytest

from benchmarks.faults.watch import LightMeter
from picoradar.instrument.line import ScanLine
from picoradar.instrument.settings import Settings, override
from picoradar.sim.faults import Fault, arm
from tests.system.conftest import Radar

WITHIN_S = 1.0


@pytest.mark.parametrize("kind", ["unplugged", "silent"])
@pytest.mark.parametrize("link", ["dg645", "genesys"])
@pytest.mark.parametrize("mode", ["sweep", "window"])
@pytest.mark.parametrize("after_s", [0.07, 0.61])
def test_light_ends_within_a_second_of_the_loss(mode: str, link: str, kind: str, after_s: float, tmp_path: Any) -> None:
    radar = Radar(override(Settings(), {"scan": {"rows": 3, "columns": 24, "mode": mode}}), tmp_path)
    meter = LightMeter(radar.sim)
    lost: list[float] = []

    def cut(line: ScanLine) -> None:
        if line.index == 0:
            lost.append(radar.clock.now() + after_s)
            fault = {"kind": kind, "link": link, "at": {"time_s": lost[0]}, "lasts_s": 3.0}
            arm(radar.sim, [Fault.model_validate(fault)])

    radar.get_ready()
    outcome = radar.scan(cut)
    assert outcome.stop_reason == "complete"
    assert len(outcome.suspended) == 1
    assert {"dg645": "DG645", "genesys": "Genesys"}[link] in outcome.suspended[0]
    (ended_s,) = [end for begin, end in meter.times if begin < lost[0] <= end]
    assert ended_s - lost[0] < WITHIN_S
    radar.sim.close()


@pytest.mark.parametrize("kind", ["reply_lost", "reply_bit_flipped", "reply_byte_dropped", "command_lost"])
@pytest.mark.parametrize("link", ["dg645", "genesys"])
def test_one_damaged_answer_is_no_lost_link(link: str, kind: str, tmp_path: Any) -> None:
    radar = Radar(override(Settings(), {"scan": {"rows": 3, "columns": 12}}), tmp_path)

    def damage(line: ScanLine) -> None:
        if line.index == 0:
            fault = {"kind": kind, "link": link, "at": {"time_s": radar.clock.now() + 0.3}}
            arm(radar.sim, [Fault.model_validate(fault)])

    radar.get_ready()
    outcome = radar.scan(damage)
    assert outcome.stop_reason == "complete"
    assert outcome.suspended == []
    radar.sim.close()


def test_looking_after_the_second_barrier_costs_no_time_under_light(tmp_path: Any, monkeypatch: Any) -> None:
    taken = []
    for watched in (True, False):
        folder = tmp_path / str(watched)
        folder.mkdir()
        radar = Radar(override(Settings(), {"scan": {"rows": 3, "columns": 24}}), folder)
        if not watched:
            monkeypatch.setattr(radar.bench.pulser, "watch", lambda: None)
        radar.get_ready()
        taken.append(radar.scan().device_time_s)
        radar.sim.close()
    assert taken[0] == pytest.approx(taken[1], rel=1e-3)
