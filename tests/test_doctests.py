"""The examples in the docstrings of what a user calls first are run, and each of these has one."""

from __future__ import annotations

import doctest
from collections.abc import Callable
from typing import Any

import pytest

import picoradar
from picoradar import registration
from picoradar.instrument import ranging
from picoradar.instrument.cli.main import run
from picoradar.registration.live import LiveRegistration

pytestmark = pytest.mark.timeout(240)
FRONT = {
    "picoradar.instrument.ranging.estimate": ranging.estimate,
    "picoradar.instrument.recording.open_recording": picoradar.open_recording,
    "picoradar.registration.live.LiveRegistration": LiveRegistration,
    "picoradar.registration.load_model": registration.load_model,
    "picoradar.registration.paired_points": registration.paired_points,
    "picoradar.registration.prepare_model": registration.prepare_model,
    "picoradar.registration.register": registration.register,
    "picoradar.sim.SimulatedBench": picoradar.SimulatedBench,
}


@pytest.mark.parametrize("name", FRONT)
def test_the_example_runs(name: str, tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    if name.endswith("open_recording"):
        assert run(["scan", "--target", "plate", "--grid", "3x3", "--mode", "window", "-o", "scan.db"]) == 0
    target: Callable[..., Any] = FRONT[name]
    text = target.__doc__ or ""
    assert ">>>" in text, f"{name} has no example in its docstring"
    case = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    said: list[str] = []
    assert runner.run(case, out=said.append).failed == 0, "".join(said)
