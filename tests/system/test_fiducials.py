"""`picoradar register --fiducials`: paired points alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar.instrument.cli.main import run
from picoradar.registration.se3 import pose, rotation_from_vector, transform

TRUTH = pose(rotation_from_vector(np.array([0.3, -1.0, 0.4])), np.array([40.0, -20.0, 900.0]))


def written(tmp_path: Path, *, sd_mm: float = 0.1, count: int = 6) -> list[dict[str, Any]]:
    rng = np.random.default_rng(1)
    scanner = rng.normal(size=(count, 3)) * 40.0
    model = transform(TRUTH, scanner) + rng.normal(0.0, sd_mm, (count, 3))
    return [
        {"scanner": a.tolist(), "model": b.tolist(), "name": f"p{k}"}
        for k, (a, b) in enumerate(zip(scanner, model, strict=True))
    ]


def registered(tmp_path: Path, pairs: object, capsys: pytest.CaptureFixture[str], *more: str) -> tuple[int, Any]:
    path = tmp_path / "pairs.json"
    path.write_text(json.dumps(pairs), encoding="utf-8")
    code = run(["register", "--fiducials", str(path), *more, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_pairs_alone_give_a_pose_and_the_error_at_targets(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    places = tmp_path / "places.json"
    places.write_text(json.dumps([{"name": "far", "position": [200.0, 0, 900]}]), encoding="utf-8")
    code, found = registered(tmp_path, written(tmp_path), capsys, "--targets", str(places), "--fle-mm", "0.173")
    assert code == 0
    assert found["verdict"] == "pass"
    assert np.abs(np.array(found["model_from_scanner"]) - TRUTH)[:3, :3].max() < 0.005
    (target,) = found["targets"]
    assert 0.1 < target["rms_mm"] < target["p95_mm"] < 1.0
    assert found["expected_fre_mm"] == pytest.approx(0.173 * np.sqrt(1 - 2 / 6))
    assert {pair["name"] for pair in found["pairs"]} == {f"p{k}" for k in range(6)}


def test_a_pair_that_is_off_fails_and_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pairs = written(tmp_path)
    pairs[4]["model"][1] += 12.0
    code, found = registered(tmp_path, pairs, capsys, "--fle-mm", "0.2")
    assert code == 1
    assert found["verdict"] == "fail"
    assert "p4 is off" in found["reasons"][0]


def test_it_is_told_in_a_table_for_people(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "pairs.json"
    path.write_text(json.dumps(written(tmp_path)), encoding="utf-8")
    assert run(["register", "--fiducials", str(path)]) == 0
    assert "residuals (FRE)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("pairs", "words"),
    [([], "at least three"), ([{"scanner": [0, 0, 0]}], "model"), ({"a": 1}, "list of objects")],
)
def test_what_holds_no_pairs_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], pairs: object, words: str
) -> None:
    code, found = registered(tmp_path, pairs, capsys)
    assert code == 2
    assert words in found["error"]


def test_neither_cloud_nor_pairs_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["register", "--json"]) == 2
    assert "a cloud and a model" in json.loads(capsys.readouterr().out)["error"]
