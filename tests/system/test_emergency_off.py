"""An emergency off that comes at an awkward moment: from another thread, twice, or when a verb is just over."""

from __future__ import annotations

import io
import logging
import threading
from collections.abc import Callable
from typing import Any

import pytest

from picoradar.drivers.interfaces import TemperatureStatus
from picoradar.instrument import events
from picoradar.instrument.errors import InterlockTripped
from tests.system.conftest import Radar


def from_another_thread(verb: Callable[[], object]) -> None:
    thread = threading.Thread(target=verb)
    thread.start()
    thread.join()


def test_one_that_comes_with_the_last_reading_of_the_warm_up_is_obeyed(make_radar: Callable[[], Radar]) -> None:
    radar = make_radar()
    controller = radar.controller
    controller.connect()

    def show(status: TemperatureStatus) -> None:
        if status.stable:
            from_another_thread(controller.emergency_off)

    with pytest.raises(InterlockTripped, match="emergency off"):
        controller.warm_up(show)
    assert controller.state == "fault"
    assert controller.safe.steps["diode"] == "verified"
    assert not radar.bench.diode.status().regulating
    controller.acknowledge()
    radar.get_ready()  # and nothing of it is left
    assert radar.scan().stop_reason == "complete"


class Told(io.StringIO):
    """A log that does something when an event is written."""

    def __init__(self, event: str, act: Callable[[], object]) -> None:
        super().__init__()
        self._event, self._act = event, act

    def write(self, text: str) -> int:
        if self._event in text:
            self._event = "done"
            self._act()
        return len(text)


def test_one_that_comes_when_the_scan_has_just_ended_is_obeyed(make_radar: Callable[[], Radar]) -> None:
    ask = Told("scan ended", lambda: from_another_thread(radar.controller.emergency_off))
    events.configure(logging.INFO, ask)  # before the controller is made: it keeps the log that it finds
    radar = make_radar()
    radar.get_ready()
    with pytest.raises(InterlockTripped, match="emergency off"):
        radar.scan()
    assert radar.controller.state == "fault"
    assert radar.controller.safe.steps["diode"] == "verified"


def test_two_at_once_wait_for_each_other(radar: Radar, monkeypatch: pytest.MonkeyPatch) -> None:
    bench, steps = radar.bench, []
    second = threading.Thread(target=radar.controller.emergency_off)

    def noted(name: str, step: Callable[[], None]) -> Callable[[], None]:
        def call() -> None:
            steps.append(name)
            step()
            if len(steps) == 1:
                second.start()
                second.join(0.3)  # time enough to take an answer away, if it could

        return call

    for device, verb in ((bench.sampler, "gate_off"), (bench.pulser, "off"), (bench.galvo, "park")):
        monkeypatch.setattr(device, verb, noted(verb, getattr(device, verb)))
    assert radar.controller.emergency_off().complete
    second.join()
    assert steps == 2 * ["gate_off", "off", "park"]
    assert radar.controller.safe.complete


def test_a_connect_that_is_broken_off_before_it_has_begun_can_be_repeated(make_radar: Callable[[], Radar]) -> None:
    def interrupt() -> Any:
        raise KeyboardInterrupt

    events.configure(logging.INFO, Told("connect", interrupt))
    radar = make_radar()
    with pytest.raises(KeyboardInterrupt):
        radar.controller.connect()
    radar.controller.shut_down()
    assert radar.controller.state == "off"
    radar.get_ready()
    assert radar.controller.state == "ready"
