"""A program without the command's signal handlers is interrupted in mid-scan: the light is off, and it is said."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from benchmarks.faults.interrupts import campaign
from picoradar.instrument.errors import InterlockTripped
from picoradar.instrument.line import ScanLine


@pytest.mark.parametrize(("times", "kind"), [(1, KeyboardInterrupt), (2, KeyboardInterrupt), (3, MemoryError)])
def test_an_exception_at_any_line_of_the_controller_ends_in_the_dark_and_says_so(
    times: int, kind: type[BaseException]
) -> None:
    found = campaign(times, kind, seed=times, most=6)
    assert len(found) >= 6
    assert [outcome for outcome in found if not outcome.sound] == []


@pytest.mark.slow
@pytest.mark.timeout(900)  # some 600 scans
@pytest.mark.parametrize("times", [1, 2])
def test_the_whole_campaign(times: int) -> None:
    found = campaign(times, KeyboardInterrupt, seed=77)
    assert len({outcome.raised_at[0] for outcome in found if outcome.raised_at}) >= 300
    assert [outcome for outcome in found if not outcome.sound] == []


def test_shut_down_in_a_scan_is_an_emergency_off_and_closes_the_links_afterwards(radar: Any) -> None:
    lit_after: list[bool] = []

    def viewer(line: ScanLine) -> None:
        if line.index == 1:
            radar.controller.shut_down()
            lit_after.append(radar.lit)

    with pytest.raises(InterlockTripped, match="emergency off"):
        radar.scan(viewer)
    assert lit_after == [False]
    assert radar.controller.state == "fault"
    assert radar.controller.safe.complete
    assert radar.controller.safe.steps["diode"] == "verified"
    with radar.last_recording() as recording:
        assert recording.done == [0, 1]
    assert radar.controller.shut_down().complete
    assert not any(device.link.is_open for device in (radar.bench.sampler, radar.bench.diode))
    assert radar.controller.state == "fault"  # latched until a person has read the cause
    assert "emergency off" in radar.controller.acknowledge()
    radar.get_ready()
    assert radar.scan().stop_reason == "complete"


def test_another_thread_only_asks_for_the_emergency_off(radar: Any) -> None:
    returned: list[bool] = []

    def press() -> None:
        returned.append(radar.controller.emergency_off().laser_off_verified)

    def viewer(line: ScanLine) -> None:
        if line.index == 0:
            button = threading.Thread(target=press)
            button.start()
            button.join()
            assert radar.lit  # the thread that scans owns the devices; it obeys at its next point

    with pytest.raises(InterlockTripped, match="emergency off"):
        radar.scan(viewer)
    assert len(returned) == 1
    assert not radar.lit
    assert radar.controller.state == "fault"


@pytest.mark.parametrize("state", ["off", "connected", "ready", "fault"])
def test_shut_down_is_allowed_in_every_state(radar: Any, state: str) -> None:
    if state != "ready":
        radar.controller.shut_down()
    if state == "connected":
        radar.controller.connect()
    if state == "fault":
        radar.get_ready()
        radar.controller.emergency_off()
    assert radar.controller.state == state
    assert radar.controller.shut_down().laser_off_verified
    assert radar.controller.state == ("fault" if state == "fault" else "off")


def test_an_emergency_off_that_comes_while_a_scan_ends_is_obeyed(radar: Any) -> None:
    """The second Ctrl-C: the first is on its way out already."""
    park = radar.bench.galvo.park

    def park_and_press() -> None:
        park()
        radar.controller.request("emergency off")
        radar.bench.galvo.park = park

    def viewer(line: ScanLine) -> None:
        if line.index == 1:
            radar.bench.galvo.park = park_and_press
            radar.controller.request("interrupt")

    with pytest.raises(InterlockTripped, match="emergency off"):
        radar.scan(viewer)
    assert radar.controller.state == "fault"
    assert radar.controller.safe.steps["diode"] == "verified"
    with radar.last_recording() as recording:
        assert "emergency off" in recording.stop_reason
        assert recording.laser_off_verified
