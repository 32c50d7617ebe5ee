"""Sinks off the thread that scans: a slow, a failing and a hanging one hold nothing, and say how far they came."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

import pytest

from picoradar.instrument.controller import Subscription, subscribers
from picoradar.instrument.controller.subscribers import Subscribers


class Log:
    def __init__(self) -> None:
        self.errors: list[dict[str, Any]] = []

    def error(self, _event: str, **fields: Any) -> None:
        self.errors.append(fields)


def line(index: int) -> Any:
    return SimpleNamespace(index=index)


def threaded(*sinks: Any) -> tuple[Subscribers, Log]:
    log: Any = Log()
    return Subscribers(sinks, log, in_line=False), log


def test_a_consumer_gets_every_line_in_its_order_however_late_it_is() -> None:
    go_on, seen = threading.Event(), []

    def slow(one: Any) -> None:
        go_on.wait(10)
        seen.append(one.index)

    feeds, _ = threaded(Subscription(slow, "registration", every_line=True))
    for index in range(100):
        feeds.take(line(index))  # returns while the first is still being looked at
    assert seen == []
    go_on.set()
    assert feeds.finish() == {"registration": "complete"}
    assert seen == list(range(100))


def test_a_viewer_that_is_too_slow_sees_the_newest_lines_and_says_what_it_missed() -> None:
    go_on, looking, seen = threading.Event(), threading.Event(), []

    def slow(one: Any) -> None:
        looking.set()
        go_on.wait(10)
        seen.append(one.index)

    feeds, _ = threaded(slow)
    feeds.take(line(0))
    assert looking.wait(10)
    for index in range(1, 30):
        feeds.take(line(index))
    go_on.set()
    missed = 29 - 8  # a viewer may be eight lines behind
    assert feeds.finish() == {"slow": f"{30 - missed} of 30 lines seen, {missed} skipped"}
    assert seen == [0, *range(22, 30)]


@pytest.mark.parametrize("error", [ValueError("no display"), SystemExit(1), KeyboardInterrupt()], ids=repr)
def test_one_that_raises_is_left_out_and_the_others_go_on(error: BaseException) -> None:
    seen: list[int] = []

    def broken(_line: Any) -> None:
        raise error

    feeds, log = threaded(
        Subscription(broken, "display", every_line=True),
        Subscription(lambda one: seen.append(one.index), "list", every_line=True),
    )
    for index in range(3):
        feeds.take(line(index))
    states = feeds.finish()
    assert states["display"].startswith("failed after 0 of ")
    assert repr(error) in states["display"]
    assert states["list"] == "complete"
    assert seen == [0, 1, 2]
    assert [one["sink"] for one in log.errors] == ["display"]


@pytest.mark.parametrize("every_line", [False, True])
def test_one_that_hangs_for_ever_is_named_and_not_waited_for(every_line: bool, monkeypatch: Any) -> None:
    monkeypatch.setattr(subscribers, "VIEWER_WAIT_S", 0.05)
    monkeypatch.setattr(subscribers, "STALL_S", 0.05)
    feeds, _ = threaded(Subscription(lambda _: threading.Event().wait(), "hung", every_line=every_line))
    for index in range(4):
        feeds.take(line(index))
    assert feeds.finish() == {"hung": "hangs: 0 of 4 lines seen"}
    hung = [thread for thread in threading.enumerate() if thread.name == "sink hung"]
    assert hung
    assert all(thread.daemon for thread in hung)  # it does not keep the program from ending


def test_in_line_they_are_called_at_once_in_the_thread_that_scans() -> None:
    calls: list[tuple[str, int]] = []
    here = threading.get_ident()

    def sink(one: Any) -> None:
        assert threading.get_ident() == here
        calls.append(("a", one.index))

    log: Any = Log()
    feeds = Subscribers([sink, sink], log, in_line=True)
    for index in range(2):
        feeds.take(line(index))
        assert len(calls) == 2 * (index + 1)
    assert feeds.finish() == {"sink": "complete", "sink 2": "complete"}
