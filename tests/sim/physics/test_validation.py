"""The comparison with the dissertation: parts that are quick, and the page that is made of them."""

from __future__ import annotations

import json

import pytest

from picoradar.instrument.cli.main import run as command
from picoradar.sim.validation import Check, prism, run
from picoradar.sim.validation.figures import Part
from picoradar.sim.validation.laser import laser
from picoradar.sim.validation.scanning import scanning
from picoradar.sim.validation.socket import socket


@pytest.mark.parametrize("part", [lambda: laser(), lambda: scanning(2004), lambda: socket(2004)])
def test_every_value_passes(part):
    failed = [check for check in part().checks if not check.passed]
    assert failed == []


def test_nan_does_not_pass():
    check = Check("a", "1", float("nan"), 0.0, 2.0, "predicted")
    assert not check.passed
    assert check.as_json()["simulator"] is None


def test_a_known_difference_has_a_reason_and_nothing_else_has():
    with pytest.raises(ValueError, match="needs a reason"):
        Check("a", "1", 2.0, 1.5, 2.5, "known difference")
    with pytest.raises(ValueError, match="needs a reason"):
        Check("a", "1", 1.0, 0.5, 1.5, "predicted", "because")


@pytest.mark.parametrize("part", [laser, lambda: scanning(2004)])
def test_a_known_difference_passes_only_where_it_differs(part):
    """Else a simulator that came to agree would be called different for ever."""
    known = [check for check in part().checks if check.kind == "known difference"]
    assert known
    for check in known:
        assert not check.low <= float(check.dissertation) <= check.high


def test_splatting_gives_back_its_own_thickness():
    """Why that row is called put in: exact points give it without any radar."""
    model = prism._model()
    assert prism._splatted_distance(model, model).mean() == pytest.approx(prism.SPLAT_THICKNESS_MM, abs=0.05)


def test_the_command_shows_the_kinds_and_why_it_differs(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(run, "PARTS", {"Laser": lambda _seed: laser()})
    monkeypatch.setenv("COLUMNS", "240")
    assert command(["validate", "--out", str(tmp_path / "page")]) == 0
    shown = " ".join("".join(capsys.readouterr()).split())
    assert "known difference" in shown
    assert "DIFF peak power at 80 kHz less that at 20 kHz" in shown
    assert "the model's power follows the current with a slope of 2.7" in shown


def test_page_and_result(tmp_path, monkeypatch):
    bad = Part([Check("height of <something> (mm)", "1", 3.0, 0.0, 2.0, "fitted")], {})
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
        "kind": "fitted",
        "reason": "",
    }
    json.dumps(result, allow_nan=False)
    page = (tmp_path / "new" / "report.html").read_text(encoding="utf-8")
    assert "height of &lt;something&gt; (mm)" in page
    assert 'class="fail"' in page
    assert "http" not in page
    assert "known difference: the model keeps the charge" in page
    assert (tmp_path / "new" / "fig_2_08.png").stat().st_size > 1000
