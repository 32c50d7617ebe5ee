"""The calibration file: walk curve, digest, round trip, refusals."""

from __future__ import annotations

import datetime
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.instrument.calibration import Calibration, Walk
from picoradar.instrument.errors import BadInput

WALK = Walk(response_mv=(15, 20, 25, 45, 65), error_mm=(6.0, 2.5, 1.0, 0.2, 0.0), sd_mm=(0.1, 0.05, 0.02, 0.02, 0.02))


def calibration(**changes: object) -> Calibration:
    given = {
        "date": datetime.datetime(2026, 1, 31, 12, tzinfo=datetime.UTC),
        "provenance": "gray target, 12 levels",
        "mirror_separation_mm": 30.0,
        "walk": {"half-maximum": WALK},
    }
    return Calibration.model_validate(given | changes)


def test_walk_meets_its_knots_and_is_monotone_between_them() -> None:
    response = np.linspace(15, 65, 501)
    curve = WALK.at(response)
    assert curve.inside.all()
    assert (np.diff(curve.error_mm) <= 0).all()
    np.testing.assert_allclose(WALK.at(np.array(WALK.response_mv)).error_mm, WALK.error_mm, atol=1e-12)
    slope = np.gradient(curve.error_mm, response)
    np.testing.assert_allclose(curve.slope_mm_per_mv[1:-1], slope[1:-1], atol=0.02)


def test_walk_outside_its_range_is_marked_and_its_uncertainty_grows() -> None:
    curve = WALK.at(np.array([5.0, 10.0, 14.9, 15.0, 70.0, np.nan]))
    np.testing.assert_array_equal(curve.inside, [False, False, False, True, False, False])
    assert curve.error_mm[0] == 6.0
    assert curve.sd_mm[0] > curve.sd_mm[1] > curve.sd_mm[2] > 0.1
    assert curve.sd_mm[0] == pytest.approx(0.1 + 10 * 0.7)
    assert np.isnan(curve.error_mm[5])


@settings(deadline=None, max_examples=40)
@given(st.lists(st.integers(0, 10_000).map(lambda um: um / 1000), min_size=2, max_size=12))
def test_any_falling_table_gives_a_falling_curve(errors: list[float]) -> None:
    knots = tuple(float(5 * (k + 1)) for k in range(len(errors)))
    walk = Walk(response_mv=knots, error_mm=tuple(sorted(errors, reverse=True)), sd_mm=(0.1,) * len(errors))
    assert (np.diff(walk.at(np.linspace(knots[0], knots[-1], 400)).error_mm) <= 1e-12).all()


def test_a_saved_calibration_loads_the_same_and_keeps_its_digest(tmp_path: Path) -> None:
    saved = calibration(serial_numbers={"bridge": "SB-0001"}, reference_ps=[7000.0, 7600.0])
    saved.save(tmp_path / "cal.json")
    loaded = Calibration.load(tmp_path / "cal.json")
    assert loaded == saved
    assert loaded.digest == saved.digest
    assert list(tmp_path.iterdir()) == [tmp_path / "cal.json"]


def test_the_digest_is_of_the_content_not_of_the_layout() -> None:
    table = json.loads(calibration().model_dump_json())
    reordered = json.dumps(dict(reversed(table.items())), indent=7)
    elsewhere = reordered.replace("2026-01-31T12:00:00Z", "2026-01-31T14:00:00+02:00")
    assert elsewhere != reordered
    assert Calibration.from_json(elsewhere, "test").digest == calibration().digest
    assert calibration(range_zero_mm=0.001).digest != calibration().digest
    assert calibration().digest.startswith("sha256:")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"mirror_separation_mm": -1.0}, "mirror_separation_mm"),
        ({"date": "2026-01-31T12:00:00"}, "time zone"),
        ({"range_zero_mm": float("nan")}, "range_zero_mm"),
        ({"unknown": 1}, "unknown"),
        ({"walk": {"half-maximum": {"response_mv": [20, 10], "error_mm": [1, 2], "sd_mm": [0, 0]}}}, "increase"),
        ({"walk": {"half-maximum": {"response_mv": [10, 20], "error_mm": [1], "sd_mm": [0, 0]}}}, "at least 2"),
        ({"walk": {"half-maximum": {"response_mv": [10, 20, 30], "error_mm": [1, 2], "sd_mm": [0, 0]}}}, "same number"),
        ({"walk": {"guess": {"response_mv": [10, 20], "error_mm": [1, 2], "sd_mm": [0, 0]}}}, "walk"),
    ],
)
def test_what_cannot_be_is_refused_with_file_and_key(tmp_path: Path, change: dict[str, object], said: str) -> None:
    file = tmp_path / "bad.json"
    table = json.loads(calibration().model_dump_json()) | change
    file.write_text(json.dumps(table))
    with pytest.raises(BadInput, match=f"bad.json.*{said}"):
        Calibration.load(file)


def test_a_file_that_is_not_there_or_not_json_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"nowhere\.json: cannot read"):
        Calibration.load(tmp_path / "nowhere.json")
    (tmp_path / "text.json").write_text("range_zero = 1")
    with pytest.raises(BadInput, match=r"text\.json: not a valid calibration"):
        Calibration.load(tmp_path / "text.json")
