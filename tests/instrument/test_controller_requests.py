"""What people ask for: when it is obeyed, and what waits."""

from __future__ import annotations

import threading

import pytest

from picoradar.instrument.controller.requests import EndScan, Requests
from picoradar.instrument.errors import InterlockTripped


def asked(*what: str) -> Requests:
    requests = Requests()
    for one in what:
        requests.put(one)  # type: ignore[arg-type]
    return requests


def test_at_a_place_only_what_cannot_wait_is_obeyed() -> None:
    requests = asked("finish", "pause", "resume")
    requests.at_point()
    with pytest.raises(EndScan, match="finished early"):
        requests.at_line()
    with pytest.raises(EndScan, match="aborted"):
        asked("pause", "abort").at_point()
    with pytest.raises(EndScan, match="interrupted"):
        asked("interrupt").at_point()


@pytest.mark.parametrize("when", ["at_point", "at_line", "at_rest", "stop_asked"])
def test_emergency_off_is_obeyed_everywhere(when: str) -> None:
    with pytest.raises(InterlockTripped, match="emergency off") as off:
        getattr(asked("emergency off"), when)()
    assert off.value.action == "off"


def test_pause_and_resume_take_each_other_back() -> None:
    assert asked("pause").at_line() is True
    assert asked("pause", "resume").at_line() is False
    assert asked("resume", "pause").at_line() is True
    assert asked("resume").at_rest() is True
    assert asked("pause").at_rest() is False


def test_any_way_to_end_stops_work_without_light() -> None:
    assert all(asked(way).stop_asked() for way in ("finish", "abort", "interrupt"))
    assert not asked("pause", "resume").stop_asked()
    assert not asked().stop_asked()


@pytest.mark.parametrize(("what", "reason"), [("finish", "finished early"), ("registered", "registered")])
def test_ends_after_a_line_wait_for_it_and_end_a_pause_too(what: str, reason: str) -> None:
    requests = asked(what)
    requests.at_point()
    with pytest.raises(EndScan, match=reason):
        requests.at_line()
    with pytest.raises(EndScan, match=reason):
        asked(what).at_rest()
    assert asked(what).stop_asked()


def test_one_kind_is_forgotten_and_the_others_stay_in_their_order() -> None:
    requests = asked("registered", "pause", "registered", "resume")
    requests.forget("registered")
    assert requests.at_line() is False
    assert not requests.waiting()


def test_any_thread_may_ask() -> None:
    requests = Requests()
    threads = [threading.Thread(target=requests.put, args=("pause",)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert requests.waiting()
    assert requests.at_line()
    assert not requests.waiting()
