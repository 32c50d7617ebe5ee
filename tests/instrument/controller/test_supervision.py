"""The supervisor: when it beats, whom it polls when, and what it does when the bridge does not take the beat."""

from __future__ import annotations

from typing import Any

import pytest

from picoradar.drivers.errors import LinkLost
from picoradar.instrument.errors import InterlockTripped

GONE = LinkLost("sampler", "gone")
ALL = ["sampler.status", "pulser.status", "diode.status", "galvo.ready"]


@pytest.fixture
def lit(script: Any) -> Any:
    """The bench with triggers on and gate open, nothing asked yet."""
    script.gate, script.triggers_on = "on", True
    return script


def test_the_beat_comes_now_and_each_quarter_of_the_watchdog_until_it_is_stopped(script: Any) -> None:
    script.supervisor.start_beating()
    script.clock.sleep(0.6)
    assert script.times("sampler.heartbeat") == [0.0, 0.25, 0.5]
    script.supervisor.start_beating()  # one timer, not two
    script.clock.sleep(0.3)
    assert script.times("sampler.heartbeat")[3:] == pytest.approx([0.6, 0.85])
    script.supervisor.stop_beating()
    script.clock.sleep(1.0)
    assert len(script.times("sampler.heartbeat")) == 5
    script.supervisor.stop_beating()


def test_a_poll_beats_and_counts_the_quarters_from_there(lit: Any) -> None:
    lit.supervisor.start_beating()
    lit.clock.sleep(0.1)
    lit.supervisor.poll()
    lit.clock.sleep(0.3)
    assert lit.times("sampler.heartbeat") == pytest.approx([0.0, 0.1, 0.35])
    lit.supervisor.stop_beating()
    lit.supervisor.poll()  # nothing beats once it has been stopped
    assert len(lit.times("sampler.heartbeat")) == 3


def test_all_are_asked_the_fastest_link_first_and_judged_before_the_next(lit: Any) -> None:
    lit.supervisor.poll_all(emitting=True)
    assert lit.asked() == ALL
    lit.interlock_closed = False
    with pytest.raises(InterlockTripped, match="interlock line"):
        lit.supervisor.poll_all(emitting=True)
    assert lit.asked() == [*ALL, "sampler.status"]


def test_the_state_of_the_light_is_handed_on_for_bridge_and_pulser(lit: Any) -> None:
    lit.gate, lit.triggers_on = "off", False
    lit.supervisor.poll_all(emitting=False)
    with pytest.raises(InterlockTripped, match="gate"):
        lit.supervisor.poll_all(emitting=True)
    lit.gate, lit.triggers_on = "on", True
    lit.acts["pulser.status"] = [lambda: setattr(lit, "triggers_on", False)]
    with pytest.raises(InterlockTripped, match="drive voltage"):
        lit.supervisor.poll_all(emitting=True)


@pytest.mark.parametrize("emitting", [True, False])
def test_diode_and_room_on_the_disk_are_judged_with_all(lit: Any, *, emitting: bool) -> None:
    with pytest.raises(InterlockTripped, match="disk space"):
        lit.supervisor.poll_all(emitting=emitting, disk_lines=lambda: 1.0)
    lit.degc = 25.0
    with pytest.raises(InterlockTripped, match="diode limits"):
        lit.supervisor.poll_all(emitting=emitting)


def test_the_diode_is_asked_again_after_two_seconds(lit: Any) -> None:
    lit.supervisor.poll()
    for _ in range(9):
        lit.clock.sleep(0.5)
        lit.supervisor.poll()
    assert lit.times("diode.status") == [0.0, 2.0, 4.0]
    assert lit.times("sampler.status") == [0.5 * k for k in range(10)]
    lit.supervisor.poll_all(emitting=True)  # counts as well
    lit.clock.sleep(1.5)
    lit.supervisor.poll()
    assert lit.times("diode.status")[3:] == [4.5]


def test_before_a_line_all_are_asked_again_after_five_seconds(lit: Any) -> None:
    room: list[float] = []
    for _ in range(5):
        lit.supervisor.poll_before_line(lambda: room.append(lit.clock.now()) or 100.0)  # type: ignore[func-returns-value]
        lit.clock.sleep(2.5)
    assert lit.times("pulser.status") == [0.0, 5.0, 10.0] == room
    assert lit.times("sampler.status") == [0.0, 2.5, 5.0, 7.5, 10.0]
    lit.clock.sleep(2.5)
    lit.triggers_on = False
    with pytest.raises(InterlockTripped, match="trigger rate"):  # with the light on, whichever way it polls
        lit.supervisor.poll_before_line(lambda: 100.0)
    with pytest.raises(InterlockTripped, match="trigger rate"):
        lit.supervisor.poll()


def test_a_place_is_judged_with_the_light_on(lit: Any) -> None:
    lit.supervisor.poll()
    lit.clock.sleep(2.0)
    lit.degc = 25.0
    with pytest.raises(InterlockTripped, match="diode limits"):
        lit.supervisor.poll()


def test_the_reference_is_compared_with_that_of_the_first_line_of_the_run(lit: Any) -> None:
    judge = lit.supervisor.judge_line
    judge(40.0, 7400.0)
    judge(28.1, 7400.0)
    judge(55.9, None)  # still with the first, not with the one before
    with pytest.raises(InterlockTripped, match="laser output"):
        judge(27.9, 7400.0)
    with pytest.raises(InterlockTripped, match="laser output"):
        judge(56.1, 7400.0)
    lit.supervisor.begin()
    assert lit.supervisor.monitor.why() == []
    judge(27.9, 7400.0)
    with pytest.raises(InterlockTripped, match="reference pulse"):
        judge(0.0, None)
    with pytest.raises(InterlockTripped, match="reference place"):
        judge(27.9, 8600.0)


def test_a_line_whose_gate_was_shut_does_not_count(lit: Any) -> None:
    lit.gate = "locked"
    with pytest.raises(InterlockTripped, match="gate"):
        lit.supervisor.judge_line(40.0, 7400.0)
    lit.gate = "on"
    lit.supervisor.judge_line(80.0, 7400.0)  # nor does its reference
    with pytest.raises(InterlockTripped, match="laser output"):
        lit.supervisor.judge_line(40.0, 7400.0)


def test_a_beat_that_is_not_taken_stops_the_triggers_at_once_and_is_told_at_the_next_poll(lit: Any) -> None:
    lit.supervisor.start_beating()
    lit.supervisor.poll_all(emitting=True)
    lit.fails("sampler.heartbeat", GONE)
    lit.clock.sleep(1.0)
    assert lit.calls[-2:] == [(0.25, "sampler.heartbeat"), (0.25, "pulser.off")]  # and no beat after it
    for poll in (lit.supervisor.poll, lambda: lit.supervisor.judge_line(45.0, 7400.0)):
        with pytest.raises(LinkLost):
            poll()
    lit.triggers_on = True
    lit.supervisor.start_beating()
    lit.supervisor.poll()


def test_the_failure_is_raised_before_anything_else_is_asked(lit: Any) -> None:
    lit.supervisor.start_beating()
    lit.fails("sampler.heartbeat", GONE)
    lit.clock.sleep(0.3)
    before = lit.asked()
    with pytest.raises(LinkLost):
        lit.supervisor.poll()
    assert lit.asked() == before


@pytest.mark.parametrize("emitting", [True, False])
def test_the_triggers_are_left_alone_in_the_middle_of_a_question_or_without_light(lit: Any, *, emitting: bool) -> None:
    lit.supervisor.start_beating()
    lit.supervisor.poll_all(emitting=True)
    lit.supervisor.poll_all(emitting=emitting)
    if emitting:
        lit.acts["pulser.status"] = [lambda: lit.clock.sleep(0.3)]
    lit.fails("sampler.heartbeat", GONE)
    if emitting:
        with pytest.raises(LinkLost):
            lit.supervisor.poll_all(emitting=True)
    lit.clock.sleep(0.3)
    assert len(lit.times("sampler.heartbeat")) == 2
    assert "pulser.off" not in lit.asked()


def test_after_the_end_of_the_light_the_triggers_are_not_touched_until_the_pulser_was_asked(lit: Any) -> None:
    lit.supervisor.poll_all(emitting=True)
    lit.supervisor.stop_beating()
    lit.supervisor.start_beating()
    lit.fails("sampler.heartbeat", GONE)
    lit.clock.sleep(0.3)
    assert "pulser.off" not in lit.asked()


def test_a_pulser_that_cannot_be_stopped_either_is_noted(lit: Any) -> None:
    lit.supervisor.start_beating()
    lit.supervisor.poll_all(emitting=True)
    failure = LinkLost("sampler", "gone")
    lit.fails("sampler.heartbeat", failure)
    lit.fails("pulser.off", LinkLost("pulser", "gone too"))
    lit.clock.sleep(0.3)
    with pytest.raises(LinkLost) as found:
        lit.supervisor.poll()
    assert found.value is failure
    assert found.value.__notes__ == ["and the pulser could not be switched off: pulser: gone too"]
