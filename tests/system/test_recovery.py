"""Lost links: the scan waits, checks who is there, and goes on with nothing wrong; or it ends cleanly."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from benchmarks.faults.cables import PULLS, pull
from benchmarks.faults.endurance import endure
from picoradar.drivers.errors import LinkLost
from picoradar.instrument.errors import InterlockTripped
from picoradar.sim.faults import Fault, arm


@pytest.mark.parametrize("link", PULLS)
def test_a_cable_pulled_in_every_line_and_plugged_in_again_leaves_no_wrong_point(link: str, tmp_path: Path) -> None:
    found = pull(link, rows=4, columns=3, folder=tmp_path, away_s=1.5)
    assert (found["lines"], found["wrong"], found["verified"]) == (4, 0, True)
    assert found["waits"] > 0 or link in ("dg645", "genesys", "tec")  # nobody asked them just then


@pytest.mark.parametrize("link", PULLS)
def test_a_cable_that_stays_away_ends_the_scan_with_the_lines_so_far(radar: Any, link: str) -> None:
    def away(line: Any) -> None:
        if line.index == 1:
            at = {"time_s": radar.clock.now() + 0.2}
            arm(radar.sim, [Fault.model_validate({"kind": PULLS[link], "link": link, "at": at})])
            if link in ("dg645", "genesys", "tec"):
                radar.controller.request("pause")  # the next to ask them is the way to the pause
                radar.clock.call_at(radar.clock.now() + 2.0, lambda: radar.controller.request("resume"))

    before = radar.clock.now()
    with pytest.raises(LinkLost):
        radar.scan(away)
    assert radar.controller.state == "fault"
    assert not radar.lit
    assert radar.controller.safe.laser_off_verified
    assert radar.clock.now() - before < 120.0
    with radar.last_recording() as recording:
        assert {0, 1} <= set(recording.done)
        assert recording.laser_off_verified


def test_another_device_on_the_port_ends_the_scan(radar: Any) -> None:
    def swap(line: Any) -> None:
        if line.index == 1:
            backend, tap = radar.sim.usb_backend, radar.sim.usb_taps["bridge"]
            backend.unplug(tap)
            radar.sim.bridge.info = replace(radar.sim.bridge.info, serial_number="SB-0666")
            radar.clock.call_at(radar.clock.now() + 1.0, lambda: backend.plug(tap))

    with pytest.raises(InterlockTripped, match=r"SB-0666.*it was.*SB-0001"):
        radar.scan(swap)
    assert radar.controller.state == "fault"
    assert not radar.lit


def test_scanning_again_and_again_and_many_connections_leave_memory_and_files_as_they_were() -> None:
    with tempfile.TemporaryDirectory() as folder:
        grown_mb, grown_files, run = endure(Path(folder), hours=0.02)
        assert run.lines == 10 * run.scans > 0
        assert (grown_mb < 4.0, grown_files) == (True, 0)
        grown_mb, grown_files, _ = endure(Path(folder), connections=40)
        assert (grown_mb < 4.0, grown_files) == (True, 0)
