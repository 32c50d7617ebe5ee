"""The supervisor looks after the second barrier with its beats, and goes on with its polls after a stop."""

from __future__ import annotations

from typing import Any

import pytest

from picoradar.drivers.errors import LinkLost
from picoradar.instrument.errors import InterlockTripped

GONE = LinkLost("pulser", "gone")


@pytest.fixture
def lit(script: Any) -> Any:
    """The bench with light, all devices polled once, and beating; the pulser answers at once."""
    script.gate, script.triggers_on = "on", True
    script.answers["pulser.watch"] = True
    script.supervisor.start_beating()
    script.supervisor.poll_all(emitting=True)
    script.calls.clear()
    return script


def test_it_looks_with_each_beat(lit: Any) -> None:
    lit.clock.sleep(1.1)
    assert lit.times("pulser.watch") == lit.times("sampler.heartbeat") == pytest.approx([0.25, 0.5, 0.75, 1.0])


def test_between_points_it_looks_no_more_often(lit: Any) -> None:
    for _ in range(16):
        lit.clock.sleep(0.125)
        lit.supervisor.poll()
    assert lit.times("pulser.watch") == pytest.approx([0.125 + 0.25 * k for k in range(8)])


def test_while_an_answer_is_under_way_it_looks_again_with_the_next_poll(lit: Any) -> None:
    lit.answers["pulser.watch"] = None
    for _ in range(4):
        lit.clock.sleep(0.05)
        lit.supervisor.poll()
    assert lit.times("pulser.watch") == pytest.approx([0.05, 0.1, 0.15, 0.2])


def test_it_does_not_look_before_the_pulser_was_seen_on_nor_without_light(script: Any) -> None:
    script.answers["pulser.watch"] = True
    script.supervisor.start_beating()
    script.clock.sleep(1.0)
    assert script.times("pulser.watch") == []
    script.gate, script.triggers_on = "off", False
    script.supervisor.poll_all(emitting=False)
    script.clock.sleep(1.0)
    assert script.times("pulser.watch") == []


def test_a_lost_pulser_closes_the_gate_at_once_and_is_the_failure_of_the_run(lit: Any) -> None:
    lit.fails("pulser.watch", GONE)
    lit.clock.sleep(0.3)
    assert lit.asked()[-2:] == ["pulser.watch", "sampler.gate_off"]
    lit.clock.sleep(1.0)
    assert lit.asked()[-1] == "sampler.gate_off"  # no beat any more
    with pytest.raises(LinkLost, match="gone"):
        lit.supervisor.poll()
    starved = LinkLost("sampler", "no record came")
    assert lit.supervisor.first_failure(starved) is GONE
    emergency = InterlockTripped("emergency off", "asked for", action="off")
    assert lit.supervisor.first_failure(emergency) is emergency
    lit.supervisor.rest()
    assert lit.supervisor.first_failure(starved) is starved


def test_a_gate_that_cannot_be_closed_either_is_told_with_it(lit: Any) -> None:
    lit.fails("pulser.watch", GONE)
    lit.fails("sampler.gate_off", LinkLost("bridge", "gone as well"))
    lit.clock.sleep(0.3)
    assert any("gone as well" in note for note in GONE.__notes__)


def test_polls_are_due_where_a_scan_goes_on_when_they_would_have_been(lit: Any) -> None:
    supervisor = lit.supervisor
    lit.clock.sleep(2.5)
    supervisor.poll()  # the diode, after two seconds
    lit.clock.sleep(0.5)
    state = supervisor.state_dict()
    assert state == {"all_age_s": 3.0, "diode_age_s": 0.5, "first_reference_mv": None}
    supervisor.judge_line(45.0, 7400.0)
    assert supervisor.state_dict()["first_reference_mv"] == 45.0
    lit.clock.sleep(100.0)
    supervisor.load_state({**state, "first_reference_mv": 44.0})
    lit.calls.clear()
    supervisor.poll_before_line(lambda: 9.0)
    assert lit.asked("pulser.status", "diode.status") == []
    assert supervisor.state_dict() == {"all_age_s": 3.0, "diode_age_s": 0.5, "first_reference_mv": 44.0}
    lit.clock.sleep(1.6)
    supervisor.poll_before_line(lambda: 9.0)
    assert lit.asked("pulser.status", "diode.status") == ["diode.status"]
    lit.clock.sleep(0.5)
    supervisor.poll_before_line(lambda: 9.0)
    assert lit.asked("pulser.status", "diode.status") == ["diode.status", "pulser.status", "diode.status"]


@pytest.mark.parametrize(
    "recorded",
    [
        {},
        {"all_age_s": None, "diode_age_s": "long"},
        {"all_age_s": -1e300, "diode_age_s": -0.001, "first_reference_mv": -45.0},  # would put the polls off for ever
        {"all_age_s": float("nan"), "diode_age_s": float("nan"), "first_reference_mv": float("nan")},
        [1, 2],
        "all",
    ],
)
def test_without_a_usable_recorded_state_nothing_is_changed(lit: Any, recorded: Any) -> None:
    lit.clock.sleep(1.0)
    before = lit.supervisor.state_dict()
    lit.supervisor.load_state(recorded)
    lit.supervisor.poll_before_line(lambda: 9.0)
    assert lit.supervisor.state_dict() == before
