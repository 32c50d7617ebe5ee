"""The comparison with the dissertation: parts that are quick, and the page that is made of them."""

from __future__ import annotations

import json

import pytest

from picoradar.sim.validation import Check, run
from picoradar.sim.validation.figures import Part
from picoradar.sim.validation.laser import laser
from picoradar.sim.validation.scanning import scanning
from picoradar.sim.validation.socket import socket


@pytest.mark.parametrize("part", [lambda: laser(), lambda: scanning(2004), lambda: socket(2004)])
def test_every_value_passes(part):
    failed = [check for check in part().checks if not check.passed]
    assert failed == []


def test_nan_does_not_pass():
    check = Check("a", "1", float("nan"), 0.0, 2.0)
    assert not check.passed
    assert check.as_json()["simulator"] is None


def test_page_and_result(tmp_path, monkeypatch):
    bad = Part([Check("height of <something> (mm)", "1", 3.0, 0.0, 2.0)], {})
    monkeypatch.setattr(run, "PARTS", {"Laser": lambda _seed: laser(), "Bad": lambda _seed: bad})
    reported = []
    result = run.validate(tmp_path / "new", seed=1, progress=reported.append)
    assert reported == ["Laser", "Bad"]
    assert not result["passed"]
    assert result["figures"][-1] == {
        "name": "height of <something> (mm)",
        "dissertation": "1",
        "simulator": 3.0,
        "tolerance": "0 to 2",
        "passed": False,
    }
    json.dumps(result, allow_nan=False)
    page = (tmp_path / "new" / "report.html").read_text(encoding="utf-8")
    assert "height of &lt;something&gt; (mm)" in page
    assert 'class="fail"' in page
    assert "http" not in page
    assert (tmp_path / "new" / "fig_2_08.png").stat().st_size > 1000
