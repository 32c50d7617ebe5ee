"""Viewers of a scan on a real clock, with the bench in another process: none of them holds the beam."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.faults.viewers import compare, served
from picoradar.instrument.controller import subscribers
from picoradar.instrument.settings import override

SLEEP_S = 1.5  # of wall time in a line: the bridge's watchdog closes the gate after one second


@pytest.mark.slow  # in real time: a computer with twice the load that it has cores for starves it
def test_no_viewer_holds_the_scan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subscribers, "STALL_S", 2 * SLEEP_S)
    with served(tmp_path / "bench", 5.0) as settings:
        found = compare(override(settings, {"scan": {"rows": 3, "columns": 20}}), tmp_path, SLEEP_S)
    watched = found.watched
    assert (watched.stop_reason, watched.lines, watched.suspended) == ("complete", 3, [])
    assert watched.safe.complete
    assert watched.sinks["slow"] == "complete"
    assert watched.sinks["broken"].startswith("failed after 0 of ")
    assert watched.sinks["hung"] == "hangs: 0 of 3 lines seen"
    assert found.seen == [0, 1, 2]
