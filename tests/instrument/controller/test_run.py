"""A run on a scripted bench: the order of all steps, what is written down, and how it ends."""

from __future__ import annotations

from typing import Any

import pytest

from picoradar.drivers.errors import DeviceFault, LinkLost
from picoradar.instrument.errors import InterlockTripped

ALL = ["sampler.status", "pulser.status", "diode.status", "galvo.ready"]
DARK = ["sampler.gate_off", "pulser.off", "sampler.stop", "galvo.park"]
VERIFIED = {"gate": "verified", "pulser": "verified", "run": "verified", "mirrors": "verified"}
PLACE_S, LINE_S = 0.125, 0.5


def test_a_scan_takes_its_steps_in_order_and_ends_dark_and_written_down(script: Any) -> None:
    script.always["galvo.park"] = lambda: script.clock.sleep(0.25)
    outcome = script.run().run()
    asked = script.asked()
    assert asked[:11] == [
        *ALL, "sampler.status", "pulser.configure", "job.configure", "sampler.heartbeat", "pulser.on",
        "sampler.gate_on", "event laser on",
    ]  # fmt: skip
    first = asked.index("line 0")
    assert asked[first : first + 3] == ["line 0", "sampler.status", "append"]  # judged before it is kept
    assert asked[-6:] == [*DARK, "event safe state", "finish"]
    assert (outcome.stop_reason, outcome.lines, outcome.points) == ("complete", 3, 9)
    assert outcome.flags == {"no echo": 3, "mixed": 6}
    assert outcome.device_time_s == pytest.approx(3 * LINE_S)  # from the first place, not from the light
    assert outcome.dark_s == pytest.approx(0.25)
    assert [index for index, _ in script.told("line")] == [0, 1, 2]
    assert [at for _, at in script.told("line")] == pytest.approx(script.times("append"))
    assert script.kinds() == [("laser on", "scanning"), ("safe state", "ready")]
    assert script.told("event")[-1][3] == VERIFIED
    (finish,) = script.told("finish")
    summary = {"device_time_s": outcome.device_time_s, "flags": {"no echo": 3, "mixed": 6}, "suspended": []}
    assert finish == ("complete", True, summary)
    assert script.told("state")[3:] == [("start_scan", "scanning"), ("end_scan", "ready")]
    assert script.told("info")[-1][0] == "scan ended"
    beats = len(script.times("sampler.heartbeat"))
    script.clock.sleep(2.0)
    assert len(script.times("sampler.heartbeat")) == beats


def test_a_job_without_rows_makes_no_light(script: Any) -> None:
    script.rows = []
    assert script.run().run().stop_reason == "complete"
    assert script.asked() == [*DARK, "event safe state", "finish"]
    assert script.machine.state == "ready"


@pytest.mark.parametrize(("way", "lines"), [("finish", 2), ("abort", 1), ("interrupt", 1)])
def test_what_was_asked_for_is_obeyed_at_its_point(script: Any, way: str, lines: int) -> None:
    script.acts["append"] = [lambda: script.clock.call_at(script.clock.now() + 0.2, lambda: script.requests.put(way))]
    outcome = script.run().run()
    assert outcome.lines == lines
    assert outcome.stop_reason == {"finish": "finished early", "abort": "aborted", "interrupt": "interrupted"}[way]
    assert script.machine.state == "ready"
    assert script.told("finish")[0][:2] == (outcome.stop_reason, True)


def test_a_sink_that_knows_enough_ends_the_scan_after_its_line(script: Any) -> None:
    seen: list[int] = []

    def sink(line: Any) -> None:
        seen.append(line.index)
        if line.index == 1:
            script.requests.put("registered")

    outcome = script.run(sink).run()
    assert (outcome.stop_reason, outcome.lines, seen) == ("registered", 2, [0, 1])
    assert script.told("event")[-1][3] == VERIFIED
    assert script.told("finish")[0][:2] == ("registered", True)
    assert script.machine.state == "ready"


def test_what_a_sink_asked_for_too_late_does_not_end_the_next_scan(script: Any) -> None:
    script.requests.put("registered")
    assert script.run().run().stop_reason == "complete"
    script.requests.put("finish")  # a person who asked before the scan gets it
    assert script.run().run().stop_reason == "finished early"


def test_memory_is_stored_before_the_line_that_it_belongs_to(script: Any) -> None:
    script.memory = {"reference": 7400.0}
    script.run().run()
    told = [what for what in script.asked() if what in ("append", "event memory")]
    assert told == ["event memory", "append"] * 3
    events = [fields for _, kind, _, fields in script.told("event") if kind == "memory"]
    supervision = [fields.pop("supervision") for fields in events]
    assert events == [{"line": k, "reference": 7400.0} for k in range(3)]
    assert [one["first_reference_mv"] for one in supervision] == [45.0] * 3
    times = script.times("event memory")
    assert times[1] - times[0] == pytest.approx(supervision[1]["all_age_s"] - supervision[0]["all_age_s"])


def test_where_a_scan_goes_on_the_lines_before_are_taken_again_and_dropped_and_polls_are_due_as_before(
    script: Any,
) -> None:
    ages = {"all_age_s": 4.2, "diode_age_s": 0.5, "first_reference_mv": 44.0}
    script.rows = [2]
    script.run_ups, script.recorded = {2: [0, 1]}, {0: {"supervision": ages}}
    script.run().run()
    steps = [what for what in script.asked() if what.startswith(("line", "recall"))]
    assert steps == ["recall 0", "line 0", "recall 1", "line 1", "recall 2", "line 2"]
    assert [index for index, _ in script.told("line")] == [2]
    # Two lines of 0.5 s each: the poll of all devices, due 5 s after the last, comes before the third, not the second.
    first, second, third = (script.times(f"line {k}")[0] for k in range(3))
    polls = [time for time in script.times("pulser.status") if time > first]
    assert len(polls) == 1
    assert second <= polls[0] < third


def test_a_viewer_that_fails_is_left_out_and_the_others_go_on(script: Any) -> None:
    seen: list[tuple[str, int]] = []

    def broken(line: Any) -> None:
        seen.append(("broken", line.index))
        raise RuntimeError("no display")

    script.run(broken, lambda line: seen.append(("sound", line.index))).run()
    assert seen == [("broken", 0), ("sound", 0), ("sound", 1), ("sound", 2)]
    assert script.told("error") == [
        ("sink failed and is left out", {"sink": "broken", "line": 0, "error": "RuntimeError('no display')"}),
    ]


# Failures


def test_a_defect_ends_dark_in_fault_and_is_written_down(script: Any) -> None:
    script.fails("line 1", RuntimeError("a defect"))
    with pytest.raises(RuntimeError, match="a defect"):
        script.run().run()
    assert (script.machine.state, script.machine.cause) == ("fault", "a defect")
    assert script.asked()[-6:] == [*DARK, "event safe state", "finish"]
    assert script.kinds()[-1] == ("safe state", "fault")
    assert script.told("finish")[0][:2] == ("RuntimeError: a defect", True)


def test_a_failure_without_words_is_named_by_its_kind(script: Any) -> None:
    script.fails("line 1", KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        script.run().run()
    assert script.machine.cause == "KeyboardInterrupt"


@pytest.mark.parametrize("what", ["event safe state", "finish"])
def test_the_first_failure_is_the_one_that_is_raised(script: Any, what: str) -> None:
    script.fails("line 1", RuntimeError("a defect"))
    script.fails(what, OSError("the disk is full"))
    with pytest.raises(RuntimeError, match="a defect"):
        script.run().run()
    assert script.told("error")[-1][0] == "the end of the scan could not be recorded"


def test_an_interlock_before_the_light_refuses_the_scan_and_leaves_it_ready(script: Any) -> None:
    script.interlock_closed = False
    with pytest.raises(InterlockTripped, match="interlock line"):
        script.run().run()
    assert script.machine.state == "ready"
    assert not {"pulser.on", "pulser.configure", "diode.off"} & set(script.asked())
    assert script.told("finish")[0][0].startswith("InterlockTripped: ")


def test_an_interlock_of_the_gravest_kind_latches_before_the_light_and_stops_the_diode(script: Any) -> None:
    script.regulating = False
    with pytest.raises(InterlockTripped, match="diode regulation"):
        script.run().run()
    assert script.machine.state == "fault"
    assert script.asked()[-7:-2] == [*DARK, "diode.off"]


def test_another_failure_before_the_light_is_a_fault(script: Any) -> None:
    script.fails("pulser.configure", DeviceFault("pulser", "refused"))
    with pytest.raises(DeviceFault):
        script.run().run()
    assert script.machine.state == "fault"


def test_an_interlock_in_the_light_is_a_fault_and_not_waited_for(script: Any) -> None:
    script.acts["line 1"] = [lambda: setattr(script, "gate", "locked")]
    with pytest.raises(InterlockTripped, match="gate"):
        script.run().run()
    assert script.machine.state == "fault"
    assert "diode.off" not in script.asked()
    assert script.told("finish")[0][2]["suspended"] == []


def test_a_refusal_names_the_interlock_behind_it(script: Any) -> None:
    def refuse() -> None:
        script.interlock_closed = False
        raise DeviceFault("pulser", "refused")

    script.acts["pulser.on"] = [refuse]
    with pytest.raises(DeviceFault):
        script.run().run()
    assert script.machine.cause.startswith("pulser: refused; interlock 'interlock line': ")


def test_a_refusal_with_nothing_behind_it_stands_alone(script: Any) -> None:
    script.fails("line 1", DeviceFault("pulser", "refused"))
    with pytest.raises(DeviceFault):
        script.run().run()
    assert script.machine.cause == "pulser: refused"  # an open gate is no interlock without light


def test_a_disk_that_is_too_small_refuses_the_scan(script: Any, free_bytes: dict[str, float]) -> None:
    free_bytes["free"] = 2999.0
    with pytest.raises(InterlockTripped, match="3 lines take"):
        script.run().run()
    assert script.asked() == [*DARK, "event safe state", "finish"]
    assert script.machine.state == "ready"


def test_light_that_cannot_be_proven_off_is_a_fault_of_a_scan_that_was_complete(script: Any) -> None:
    script.fails("sampler.gate_off", LinkLost("sampler", "gone"))
    script.fails("pulser.off", LinkLost("pulser", "gone"))
    outcome = script.run().run()
    assert outcome.stop_reason == "complete"
    assert script.machine.state == "fault"
    assert script.machine.cause.startswith("LASER NOT VERIFIED OFF")
    assert script.told("finish")[0][:2] == ("complete", False)
    assert script.told("critical")[-1][0] == "scan ended"
    assert script.asked().count("finish") == 1


def test_the_interlocks_are_polled_before_each_point(script: Any) -> None:
    later = script.clock.call_at
    script.acts["append"] = [
        lambda: later(script.clock.now() + PLACE_S, lambda: setattr(script, "interlock_closed", False))
    ]
    with pytest.raises(InterlockTripped, match="interlock line"):
        script.run().run()
    assert "line 1" not in script.asked()
    assert script.times("sampler.gate_off")[0] - script.times("append")[0] <= 2 * PLACE_S
