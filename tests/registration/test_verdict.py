"""The verdict, rule by rule: one piece of evidence at a time beside evidence that passes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from picoradar.registration import Rival, Target, Tolerance
from picoradar.registration.settings import TrustSettings
from picoradar.registration.trust.evidence import Evidence, ShownError
from picoradar.registration.trust.verdict import judge

SETTINGS = TrustSettings()


def target(p95_mm: float, bias_mm: float = 0.0) -> Target:
    return Target("centre", np.zeros(3), p95_mm / 2.0, p95_mm, bias_mm, p95_mm + 2.0 * bias_mm)


GOOD = Evidence(
    rotation_sd_deg=0.1,
    targets=[target(0.3, 0.1)],
    points=1000,
    inliers=900,
    inside_share=0.0,
    beside_share=0.0,
    misfit_mm=0.0,
    rivals=[],
    confident=True,
    range_error_known=True,
)
RIVAL = Rival(np.eye(4), 1.0, 12.3, 4.5)


def test_good_evidence_passes_with_the_random_error_and_two_deviations_of_the_common_one() -> None:
    verdict, reasons = judge(GOOD, Tolerance(), SETTINGS)
    assert verdict == "pass"
    assert reasons == [
        "Predicted rotation error 0.10 deg (rms); with 95 % probability the error at every target is under 0.50 mm, a "
        "common range error included."
    ]


def test_the_clinic_asks_for_a_degree_and_a_millimetre() -> None:
    assert Tolerance() == Tolerance(rotation_deg=1.0, target_mm=1.0)


@pytest.mark.parametrize(
    ("change", "verdict", "words"),
    [
        ({"inliers": 250}, "pass", "Predicted rotation"),
        ({"inliers": 249}, "fail", "Only 25% of the points lie on the model"),
        ({"inside_share": 0.005}, "pass", "Predicted rotation"),
        ({"inside_share": 0.006}, "caution", "0.6% of the points lie inside bone"),
        ({"inside_share": 0.03}, "caution", "3.0% of the points lie inside bone"),
        ({"inside_share": 0.031}, "fail", "3.1% of the points lie inside bone"),
        ({"beside_share": 0.005}, "pass", "Predicted rotation"),
        ({"beside_share": 0.006}, "caution", "0.6% of the points lie just beside the model"),
        ({"misfit_mm": 0.15}, "pass", "Predicted rotation"),
        ({"misfit_mm": 0.16}, "caution", "Whole patches of points lie 0.16 mm (rms) off the model"),
        ({"misfit_mm": 0.5}, "caution", "Whole patches of points lie 0.50 mm"),
        ({"misfit_mm": 0.51}, "fail", "Whole patches of points lie 0.51 mm"),
        ({"confident": False}, "caution", "The search reached this pose only once"),
        ({"rotation_sd_deg": 0.5}, "pass", "Predicted rotation"),
        ({"rotation_sd_deg": 0.51}, "caution", "The predicted rotation reaches 1.02 deg (95 %), the limit is 1 deg"),
        ({"rotation_sd_deg": 1.0}, "caution", "reaches 2.00 deg"),
        ({"rotation_sd_deg": 1.01}, "fail", "reaches 2.02 deg"),
        ({"rotation_sd_deg": 45.0}, "fail", "reaches 90.00 deg"),
        ({"rotation_sd_deg": 45.1}, "fail", "The points leave the rotation free"),
        ({"targets": [target(0.6, 0.2)]}, "pass", "Predicted rotation"),
        ({"targets": [target(0.6, 0.25)]}, "caution", "The predicted error at centre reaches 1.10 mm (95 %)"),
        ({"targets": [target(0.6, 0.25)]}, "caution", "the limit is 1 mm: scan more"),
        ({"targets": [target(0.3, 0.4)]}, "caution", "most of it a common range error: measure the material again"),
        ({"targets": [target(1.6, 0.25)]}, "fail", "reaches 2.10 mm"),
        ({"range_error_known": False}, "caution", "(picoradar bench penetration --material bone)"),
        ({"targets": [target(100.0)]}, "fail", "reaches 100.00 mm"),
        ({"targets": [target(101.0)]}, "fail", "The points leave the error at centre free"),
        ({"beyond_probability": 0.014}, "pass", "Predicted rotation"),
        ({"beyond_probability": 0.015}, "caution", "The rotation is beyond 1 deg with a probability of 1.5%"),
        ({"halves": 2.0}, "pass", "Predicted rotation"),
        ({"halves": 2.1, "halves_off": 0.5}, "pass", "Predicted rotation"),
        (
            {"halves": 2.1, "halves_off": 0.51},
            "caution",
            "Two halves of the scan, registered apart, differ by 2.1",
        ),
        ({"shown": [ShownError("walk", 0.5, 0.05, 0.2)]}, "pass", "Predicted rotation"),
        ({"shown": [ShownError("walk", 0.5, 0.05, 0.21)]}, "caution", "as if ranges grow by +0.50 mm at 60 deg"),
        ({"shown": [ShownError("mirror scale", 0.01, 1e-3, 0.3)]}, "caution", "mirror angles are +1.00 % too large"),
        (
            {"rivals": [RIVAL]},
            "caution",
            "1 other pose(s) explain the points nearly as well; the best",
        ),
    ],
)
def test_each_rule_alone(change: dict[str, object], verdict: str, words: str) -> None:
    found, reasons = judge(replace(GOOD, **change), Tolerance(), SETTINGS)  # type: ignore[arg-type]
    assert (found, len(reasons)) == (verdict, 1)
    assert words in reasons[0]


def test_limits_follow_the_tolerance_that_is_asked_for() -> None:
    strict = Tolerance(rotation_deg=0.15, target_mm=0.4)
    assert judge(GOOD, strict, SETTINGS)[0] == "caution"
    assert judge(replace(GOOD, misfit_mm=0.07), replace(strict, rotation_deg=1.0, target_mm=0.5), SETTINGS)[0] == "pass"
    assert (
        judge(replace(GOOD, misfit_mm=0.08), replace(strict, rotation_deg=1.0, target_mm=0.5), SETTINGS)[0] == "caution"
    )
    loose = Tolerance(rotation_deg=5.0, target_mm=5.0)
    assert judge(replace(GOOD, rotation_sd_deg=2.0, targets=[target(4.0)]), loose, SETTINGS)[0] == "pass"


@pytest.mark.parametrize(
    ("change", "tolerance", "verdict"),
    [
        ({"misfit_mm": 0.24}, Tolerance(target_mm=0.5), "caution"),
        ({"misfit_mm": 0.26}, Tolerance(target_mm=0.5), "fail"),
        ({"rotation_sd_deg": 3.0}, Tolerance(rotation_deg=5.0), "caution"),
        ({"rotation_sd_deg": 5.1}, Tolerance(rotation_deg=5.0), "fail"),
        ({"rotation_sd_deg": 45.0}, Tolerance(rotation_deg=60.0), "caution"),
        ({"rotation_sd_deg": 45.1}, Tolerance(rotation_deg=60.0), "fail"),  # free, however much is allowed
    ],
)
def test_what_fails_follows_it_too(change: dict[str, Any], tolerance: Tolerance, verdict: str) -> None:
    assert judge(replace(GOOD, **change), tolerance, SETTINGS)[0] == verdict


@pytest.mark.parametrize(
    ("targets", "words"),
    [([target(0.2), target(0.3, 0.2), target(0.5)], "every target is under 0.70 mm"), ([], "is under 0.00 mm")],
)
def test_a_pass_names_the_worst_target(targets: list[Target], words: str) -> None:
    assert words in judge(replace(GOOD, targets=targets), Tolerance(), SETTINGS)[1][0]


def test_what_fails_is_said_before_what_cautions() -> None:
    verdict, reasons = judge(replace(GOOD, confident=False, inliers=100), Tolerance(), SETTINGS)
    assert verdict == "fail"
    assert [reason.split()[0] for reason in reasons] == ["Only", "The"]


def test_reasons_stand_in_order_of_weight() -> None:
    """By how many times what is allowed is exceeded."""
    many = replace(GOOD, inside_share=0.02, misfit_mm=0.3, confident=False, targets=[target(1.5)])
    _, reasons = judge(many, Tolerance(), SETTINGS)
    assert [reason[:9] for reason in reasons] == ["2.0% of t", "Whole pat", "The predi", "The searc"]


def test_errors_that_look_alike_are_all_named() -> None:
    alike = [
        ShownError("walk", 0.5, 0.05, 0.3),
        ShownError("model offset", -0.3, 0.05, 0.4),
        ShownError("model scale", 0.01, 2.5e-3, 0.9),
    ]
    _, (reason,) = judge(replace(GOOD, shown=alike), Tolerance(), SETTINGS)
    assert "ranges grow by +0.50 mm" in reason
    assert "the surface lies -0.30 mm too far out" in reason
    assert "larger" not in reason
    assert "up to 0.40 mm" in reason, "the third is less than half as clear"


def test_a_range_error_that_was_never_measured_is_never_a_pass_and_hides_no_other_limit() -> None:
    unknown = replace(GOOD, range_error_known=False, targets=[target(0.3, float("nan"))])
    verdict, reasons = judge(unknown, Tolerance(), SETTINGS)
    assert verdict == "caution"
    assert "--range-bias-mm" in reasons[0]
    assert judge(replace(unknown, targets=[target(2.5, float("nan"))]), Tolerance(), SETTINGS)[0] == "fail"
