"""A run on a scripted bench: what it waits for without light, how it goes on, and when it gives up."""

from __future__ import annotations

from typing import Any

import pytest

from picoradar.drivers.errors import LinkLost
from picoradar.instrument.errors import InterlockTripped

ALL = ["sampler.status", "pulser.status", "diode.status", "galvo.ready"]
DARK = ["sampler.gate_off", "pulser.off", "sampler.stop", "galvo.park"]
VERIFIED = {"gate": "verified", "pulser": "verified", "run": "verified", "mirrors": "verified"}
PLACE_S, LINE_S = 0.125, 0.5


def test_a_disk_that_fills_up_is_noticed_before_a_line_and_waited_for(
    script: Any, free_bytes: dict[str, float]
) -> None:
    def full() -> None:
        free_bytes["free"] = 1999.0
        script.clock.call_at(script.clock.now() + 20.0, lambda: free_bytes.update(free=1e6))

    script.rows = list(range(20))
    script.acts["line 1"] = [full]
    outcome = script.run().run()
    assert outcome.lines == 20
    (why,) = outcome.suspended
    assert "disk space" in why
    assert script.times("sampler.gate_off")[0] - script.times("line 1")[0] <= 5.5  # with all, every five seconds


def test_a_pause_is_dark_until_somebody_asks_to_go_on(script: Any) -> None:
    script.acts["append"] = [lambda: script.requests.put("pause")]
    script.acts["event pause"] = [
        lambda: script.clock.call_at(script.clock.now() + 7.04, lambda: script.requests.put("resume"))
    ]
    outcome = script.run().run()
    dark = script.times("sampler.gate_off")[0]
    on = script.times("sampler.gate_on")[1]
    assert 7.04 <= on - dark <= 7.04 + 0.11
    paused = script.asked()[script.asked().index("sampler.gate_off") :]
    assert paused[:5] == [*DARK, "event pause"]
    assert paused[5:15] == [
        *ALL, "sampler.status", "pulser.configure", "job.configure", "sampler.heartbeat", "pulser.on",
        "sampler.gate_on",
    ]  # fmt: skip
    assert script.told("state")[3:] == [
        ("start_scan", "scanning"), ("pause", "paused"), ("resume", "scanning"), ("end_scan", "ready"),
    ]  # fmt: skip
    assert script.told("event")[1][1:] == ("pause", "paused", {"cause": "", **VERIFIED})
    assert (outcome.lines, outcome.suspended) == (3, [])
    settled = script.times("line 1")[0] - on
    assert settled >= 2.0 + LINE_S  # the diode is waited for after each new light
    assert outcome.device_time_s == pytest.approx(script.times("append")[-1] - script.times("line 0")[0] + LINE_S)


def test_a_line_in_which_the_diode_left_its_band_is_taken_again_when_it_is_back(script: Any) -> None:
    def warm() -> None:
        script.degc = 23.3
        script.clock.call_at(script.clock.now() + 20.0, lambda: setattr(script, "degc", 23.0))

    script.rows = list(range(20))
    script.acts["line 1"] = [warm]
    outcome = script.run().run()
    assert [index for index, _ in script.told("line")] == script.rows
    assert len(outcome.suspended) == 1
    assert "diode temperature" in outcome.suspended[0]
    event = next(e for e in script.told("event") if e[1] == "suspend")
    assert event[2] == "suspended"
    assert event[3] == {"cause": outcome.suspended[0], **VERIFIED}
    assert ("recover", "scanning") in script.told("state")
    assert script.told("finish")[0][2]["suspended"] == outcome.suspended
    on = script.times("sampler.gate_on")[1]
    waited = on - script.times("sampler.gate_off")[0]
    assert waited == pytest.approx(0.1 + 0.2 + 0.4 + 0.8 + 1.6 + 3.2 + 5.0 + 5.0 + 5.0)  # the back-off, past the 20 s
    assert "sampler.heartbeat" not in [w for t, w in script.calls if on - waited < t < on]


def test_a_lost_link_is_opened_anew_and_the_line_taken_again(script: Any) -> None:
    script.fails("line 1", LinkLost("galvo", "gone"))
    script.fails("galvo.ready", None, None)
    outcome = script.run().run()
    assert outcome.suspended == ["galvo: gone"]
    assert script.asked().count("pulser.configure") == script.asked().count("job.configure") == 2
    assert script.told("warning") == [("suspend", {"cause": "galvo: gone", "safe": "laser off verified"})]
    dark = script.asked().index("sampler.gate_off")
    assert script.asked()[dark : dark + 4] == DARK
    assert script.times("sampler.gate_on")[1] - script.times("sampler.gate_off")[0] == pytest.approx(0.1)
    assert outcome.lines == 3


def test_the_device_whose_link_is_lost_is_asked_last(script: Any) -> None:
    script.fails("line 1", LinkLost("sampler", "gone"))
    script.run().run()
    dark = script.asked().index("pulser.off")
    assert script.asked()[dark : dark + 4] == ["pulser.off", "galvo.park", "sampler.gate_off", "sampler.stop"]
    script.fails("line 1", *[LinkLost("sampler", "gone")] * 4)
    with pytest.raises(LinkLost):
        script.run().run()
    assert script.asked()[-6:-2] == ["pulser.off", "galvo.park", "sampler.gate_off", "sampler.stop"]


def away(script: Any) -> None:
    """The galvo's link is lost for good."""

    def gone() -> None:
        raise LinkLost("galvo", "gone")

    script.always["galvo.ready"] = script.always["galvo.open"] = gone
    gone()


def test_a_link_that_stays_away_ends_the_scan_after_a_minute(script: Any) -> None:
    script.acts["line 1"] = [lambda: away(script)]
    with pytest.raises(LinkLost):
        script.run().run()
    first, *_, last = script.times("galvo.open")
    assert first == pytest.approx(script.times("line 1")[0] + 0.1)
    assert 60.0 <= last - first + 0.1 <= 65.0
    assert script.machine.state == "fault"
    assert ("link still away", {"cause": "galvo: gone"}) in script.told("info")


def test_a_link_that_is_lost_in_the_dark_before_the_gate_opens_is_waited_for_again(script: Any) -> None:
    script.fails("line 1", LinkLost("galvo", "gone"))
    script.fails("pulser.on", None, LinkLost("pulser", "gone"), LinkLost("pulser", "gone"))
    outcome = script.run().run()
    assert len(script.times("pulser.on")) == 4
    opened = script.times("sampler.gate_on")[1]
    assert opened - script.times("sampler.gate_off")[0] == pytest.approx(0.1 + 0.2 + 0.4)
    between = [w for t, w in script.calls if script.times("pulser.on")[2] < t < opened]
    assert between == []  # no beat without light
    assert outcome.lines == 3


def test_a_link_that_is_lost_while_the_gate_opens_ends_the_scan(script: Any) -> None:
    script.fails("line 1", LinkLost("galvo", "gone"))
    script.fails("sampler.gate_on", None, LinkLost("sampler", "gone"))
    with pytest.raises(LinkLost):
        script.run().run()
    assert script.machine.state == "fault"
    assert len(script.times("sampler.gate_on")) == 2


def test_an_interlock_that_does_not_come_back_by_itself_ends_the_wait(script: Any) -> None:
    def both() -> None:
        script.interlock_closed = False
        raise LinkLost("galvo", "gone")

    script.acts["line 1"] = [both]
    with pytest.raises(InterlockTripped, match="interlock line"):
        script.run().run()
    assert script.clock.now() < 10.0


def test_a_diode_that_stays_away_ends_the_scan_after_ten_minutes(script: Any) -> None:
    script.rows = list(range(20))
    script.acts["line 1"] = [lambda: setattr(script, "degc", 23.3)]
    with pytest.raises(InterlockTripped, match="diode temperature"):
        script.run().run()
    assert 600.0 <= script.clock.now() - script.times("sampler.gate_off")[0] <= 606.0


@pytest.mark.parametrize("broken", [3, 4])
def test_a_line_is_tried_four_times_at_most(script: Any, broken: int) -> None:
    script.fails("line 1", *[LinkLost("galvo", "gone")] * broken)
    script.fails("line 2", *[LinkLost("galvo", "gone")] * 3)  # each line has its own tries
    if broken == 4:
        with pytest.raises(LinkLost):
            script.run().run()
        assert script.told("finish")[0][2]["suspended"] == ["galvo: gone"] * 3
    else:
        assert script.run().run().lines == 3
    assert len(script.times("line 1")) == 4


def test_what_was_asked_for_in_the_wait_is_obeyed(script: Any) -> None:
    def lost() -> None:
        script.clock.call_at(script.clock.now() + 20.0, lambda: script.requests.put("abort"))
        away(script)

    script.acts["line 1"] = [lost]
    outcome = script.run().run()
    assert outcome.stop_reason == "aborted"
    assert script.clock.now() == pytest.approx(script.times("line 1")[0] + 20.0)  # at once


def test_light_that_cannot_be_proven_off_in_a_wait_stops_everything(script: Any) -> None:
    script.fails("line 1", LinkLost("galvo", "gone"))
    script.fails("sampler.gate_off", LinkLost("sampler", "gone"))
    script.fails("pulser.off", LinkLost("pulser", "gone"))
    with pytest.raises(InterlockTripped, match="NOT VERIFIED OFF"):
        script.run().run()
    assert script.asked().count("diode.off") == 1
    assert script.machine.state == "fault"


def test_before_the_light_the_diode_is_waited_for_each_second(script: Any) -> None:
    script.degc = 23.3
    script.always["sampler.status"] = lambda: setattr(script, "degc", 23.0 if script.clock.now() > 9.5 else 23.3)
    script.supervisor.poll_all(emitting=False)
    script.clock.sleep(0.5)
    assert script.run().run().lines == 3
    assert script.times("galvo.park")[0] > script.times("pulser.on")[0] == pytest.approx(10.5, abs=1.0)
    asked = [t for t in script.times("sampler.status") if t <= 10.0]
    assert asked[1:5] == pytest.approx([0.5, 1.5, 2.5, 3.5])


def test_before_the_light_ten_minutes_are_enough(script: Any) -> None:
    script.degc = 23.3
    script.supervisor.poll_all(emitting=False)
    script.clock.sleep(0.5)
    with pytest.raises(InterlockTripped, match="600 s"):
        script.run().run()
    assert script.clock.now() == pytest.approx(600.5)
    assert script.machine.state == "ready"
    assert "pulser.on" not in script.asked()


def test_a_working_point_that_is_not_reached_is_written_down_and_the_scan_goes_on(script: Any) -> None:
    diode = script.settings.diode
    script.degc = 23.0 + 2 * diode.settled_k
    assert script.run().run().lines == 3
    assert script.kinds().count(("working point not reached", None)) == 1
    assert script.times("line 0")[0] - script.times("sampler.gate_on")[0] >= diode.settle_limit_s
