"""When a check of the range zero passes: known answers, Monte-Carlo against theory, and what counts as no check."""

from __future__ import annotations

import datetime
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from picoradar.instrument.acquisition import MarkPlan, RasterPlan, plate_range
from picoradar.instrument.calibration import (
    Calibration,
    Walk,
    ZeroDifference,
    ZeroInterval,
    ZeroLimits,
    ZeroMark,
    ZeroPlate,
    judge_zero,
    points_from,
    true_angles,
)
from picoradar.instrument.cli.session import calibration_of
from picoradar.instrument.errors import BadInput
from picoradar.instrument.settings import Settings, override

NOW = datetime.datetime(2026, 1, 31, tzinfo=datetime.UTC)


def seen(*differences_mm: float, noise_mm: float = 0.1, common_mm: float = 0.1) -> list[ZeroDifference]:
    return [ZeroDifference(f"reading {k}", d, noise_mm, common_mm) for k, d in enumerate(differences_mm)]


def bare(**values: object) -> Calibration:
    return Calibration.model_validate({"date": NOW, "provenance": "test", "mirror_separation_mm": 30.0, **values})


def test_a_difference_that_noise_and_what_is_known_explain_passes() -> None:
    check = judge_zero(seen(0.2, -0.1), "mark")
    assert check.passed
    assert check.largest_mm == 0.2
    assert check.limit_mm == pytest.approx(3 * np.sqrt(0.1**2 + 0.1**2 + 0.05**2))
    assert check.moved_mm == pytest.approx(-0.3)
    assert check.moved_limit_mm == pytest.approx(3 * np.sqrt(2 * 0.1**2 + 0.05**2))


@pytest.mark.parametrize("off_mm", [2.0, -2.0, 0.6])
def test_a_larger_one_fails_wherever_it_is_read(off_mm: float) -> None:
    for found in (seen(off_mm, off_mm), seen(0.0, off_mm), seen(off_mm, 0.0), seen(off_mm)):
        check = judge_zero(found, "mark")
        assert check.outcome == "failed"
        assert check.largest_mm == off_mm
        assert f"{off_mm:+.2f} mm" in check.sentence
        assert "calibrate" in check.sentence


def test_a_drift_between_the_readings_fails_though_each_is_within_what_is_known_of_the_mark() -> None:
    found = seen(0.45, -0.45, noise_mm=0.05, common_mm=0.2)
    assert all(judge_zero([one], "mark").passed for one in found)
    check = judge_zero(found, "mark")
    assert check.outcome == "failed"
    assert "moved by -0.90 mm" in check.sentence


@pytest.mark.parametrize("off_mm", [np.nan, 225.0, -30.0])
def test_where_the_mark_was_not_found_there_is_no_check(off_mm: float) -> None:
    check = judge_zero(seen(0.0, off_mm), "mark")
    assert check.outcome == "none"
    assert "not found reading 1" in check.sentence


def test_a_check_that_could_not_see_two_millimetres_is_none() -> None:
    assert judge_zero(seen(0.1, common_mm=0.4), "mark").outcome == "none"
    assert judge_zero(seen(0.1, noise_mm=0.4), "mark").outcome == "none"
    assert judge_zero(seen(2.5, common_mm=0.4), "mark").outcome == "failed"  # what it does see counts


def test_false_alarms_and_missed_errors_come_as_often_as_the_limits_say() -> None:
    """3 standard deviations: 0.27 % a reading. An error of 2 mm at the coarsest check: missed at most 1 in 740."""
    rng = np.random.default_rng(11)
    noise_mm, common_mm, runs = 0.2, 0.15, 4000
    limits = ZeroLimits(wander_mm=0.0)
    readings = rng.normal(0, common_mm, (runs, 1)) + rng.normal(0, noise_mm, (runs, 2))
    alarms = [
        judge_zero(seen(*pair, noise_mm=noise_mm, common_mm=common_mm), "mark", limits).outcome for pair in readings
    ].count("failed") / runs
    assert 0.0027 < alarms < 3 * 0.0027 + 3 * np.sqrt(0.008 / runs)  # two readings and their difference
    sd_mm = limits.coarsest_mm / limits.sds
    missed = sum(
        judge_zero(seen(2.0 + e, noise_mm=sd_mm, common_mm=0.0), "mark", limits).passed
        for e in rng.normal(0, sd_mm, runs)
    )
    assert missed <= runs * 0.00135 + 3 * np.sqrt(runs * 0.00135)


@given(
    differences=st.lists(st.floats(-5, 5), min_size=1, max_size=5),
    noise_mm=st.floats(0.0, 0.5),
    common_mm=st.floats(0.0, 0.5),
)
def test_what_passes_is_within_its_limit_and_fine_enough(
    differences: list[float], noise_mm: float, common_mm: float
) -> None:
    check = judge_zero(seen(*differences, noise_mm=noise_mm, common_mm=common_mm), "mark")
    mirrored = judge_zero(seen(*(-d for d in differences), noise_mm=noise_mm, common_mm=common_mm), "mark")
    assert mirrored.outcome == check.outcome
    assert json.loads(json.dumps(check.to_dict()))["outcome"] == check.outcome
    if check.passed:
        assert max(map(abs, differences)) <= (check.limit_mm or 0.0) <= ZeroLimits().coarsest_mm


def test_a_plate_is_judged_again_by_zero_and_walk_of_any_calibration() -> None:
    interval = ZeroInterval(interval_mm=374.0, sd_mm=0.02, response_mv=20.0)
    plate = ZeroPlate(date=NOW, distance_mm=800.0, sd_mm=0.1, measured={"template": interval})
    walk = Walk(response_mv=(10.0, 30.0), error_mm=(2.0, 0.0), sd_mm=(0.2, 0.2))
    assert plate_range(plate, "template", bare(range_zero_mm=426.0)) == (800.0, 0.02, 0.0)
    assert plate_range(plate, "template", bare(range_zero_mm=428.0, walk={"template": walk})) == pytest.approx(
        (801.0, 0.02, 0.2)
    )
    with pytest.raises(KeyError):
        plate_range(plate, "half-maximum", bare())


def test_fields_that_are_not_set_leave_the_digest_as_it_was() -> None:
    """Of a calibration that was written before there were marks."""
    old = bare(range_zero_mm=1.5)
    assert "zero_mark" not in old.content()
    assert old.digest == "sha256:92beb9f4673e6a661f478da53e767fe1cebe88f118b6b8e15a3a5c7ceaceeb56"
    marked = old.model_copy(update={"zero_mark": ZeroMark(x_deg=4, y_deg=4, range_mm=670, sd_mm=0.1)})
    assert marked.digest != old.digest
    assert Calibration.from_json(json.dumps(marked.content()), "here") == marked


@pytest.mark.parametrize("range_mm", [649.0, 701.0])
def test_a_mark_nearer_than_the_overlap_or_too_far_is_refused(range_mm: float) -> None:
    mark = {"x_deg": 4.0, "y_deg": 4.0, "range_mm": range_mm, "sd_mm": 0.1}
    with pytest.raises(BadInput, match=r"zero_mark\.range_mm"):
        Calibration.from_json(json.dumps({**bare().content(), "zero_mark": mark}), "mine.json")


def test_the_beam_goes_to_the_mark_through_the_errors_of_the_scanner() -> None:
    settings = Settings()
    calibration = calibration_of(settings)
    skewed = Calibration.model_validate(
        {
            **calibration.model_dump(),
            "scanner": {"x_offset_rad": 0.005, "y_scale": 0.01, "non_orthogonality_rad": 0.004},
        }
    )
    plan = MarkPlan.of(settings, skewed)
    assert plan is not None
    found_deg = np.degrees(true_angles(plan.angles_rad, skewed.scanner))
    assert found_deg == pytest.approx([4.3, 4.3], abs=10.0 / 4096)
    assert MarkPlan.of(override(settings, {"scanner": {"zero_mark": False}}), skewed) is None
    assert MarkPlan.of(settings, calibration.model_copy(update={"zero_mark": None})) is None


@pytest.mark.parametrize(("grid", "step_mm", "inside"), [(40, 1.0, False), (60, 1.9, False), (62, 2.0, True)])
def test_a_raster_that_reaches_the_mark_is_known(grid: int, step_mm: float, inside: bool) -> None:
    settings = override(Settings(), {"scan": {"rows": grid, "columns": grid, "step_mm": step_mm}})
    calibration = calibration_of(settings)
    plan, raster = MarkPlan.of(settings, calibration), RasterPlan.of(settings, calibration)
    assert plan is not None
    corner = raster.line(0).angles_rad[-1]
    point = points_from(corner, np.array(675.0), 30.0)
    middle = points_from(plan.angles_rad, np.array(675.0), 30.0)
    meets = bool((np.abs(point - middle)[:2] < 7.0).all() or (point[:2] > middle[:2]).all())
    assert meets is inside
    assert plan.stands_in(raster) is inside
