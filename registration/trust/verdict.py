"""The verdict: from predicted errors, rivals and physics, never from the size of the residuals alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from picoradar.registration.settings import TrustSettings
from picoradar.registration.trust.evidence import Evidence, Tolerance
from picoradar.registration.trust.result import Verdict

TINY = 1e-6
"""A share of the points that stands for none."""

UNKNOWN_RANGE_ERROR = (
    "How far all ranges are off together was never measured on this material, and it leaves no trace in the "
    "residuals: bone reads millimetres too far. Measure it on a sample (picoradar bench penetration --material bone), "
    "scan with that calibration and --material bone; or state what is left of it (--range-bias-mm)."
)


@dataclass(frozen=True)
class _Finding:
    """What speaks against a pose: whether it fails it, and its weight: how many times beyond what is allowed."""

    fails: bool
    weight: float
    sentence: str


def judge(evidence: Evidence, tolerance: Tolerance, settings: TrustSettings) -> tuple[Verdict, list[str]]:
    """Return the verdict and its reasons as sentences: what fails first, then by weight."""
    found = [
        *_about_points(evidence, tolerance, settings),
        *_about_search(evidence, settings),
        *_about_size(evidence, tolerance, settings),
        *_beyond_budget(evidence, tolerance, settings),
        *(_Finding(objection.fails, 1.0, objection.sentence) for objection in evidence.objections),
    ]
    if not evidence.range_error_known:
        found.append(_Finding(False, 1.0, UNKNOWN_RANGE_ERROR))
    if found:
        ordered = sorted(found, key=lambda one: (not one.fails, -one.weight))
        return "fail" if ordered[0].fails else "caution", [one.sentence for one in ordered]
    worst = max((t.stated_mm for t in evidence.targets), default=0.0)
    return "pass", [
        f"Predicted rotation error {evidence.rotation_sd_deg:.2f} deg (rms); with 95 % probability the error at every "
        f"target is under {worst:.2f} mm, a common range error included."
    ]


def _about_points(evidence: Evidence, tolerance: Tolerance, settings: TrustSettings) -> Iterator[_Finding]:
    """What the points say that lie on the model, in it, beside it and off it."""
    share = evidence.inliers / evidence.points
    if share < settings.min_inlier_share:
        yield _Finding(
            True,
            settings.min_inlier_share / max(share, TINY),
            f"Only {share:.0%} of the points lie on the model: it may be another bone, or the pose is wrong.",
        )
    if evidence.inside_share > settings.inside_caution_share:
        yield _Finding(
            evidence.inside_share > settings.inside_fail_share,
            evidence.inside_share / settings.inside_caution_share,
            f"{evidence.inside_share:.1%} of the points lie inside bone, where no beam can end: the model may be "
            "another bone, or mirrored.",
        )
    if evidence.beside_share > settings.beside_caution_share:
        yield _Finding(
            False,
            evidence.beside_share / settings.beside_caution_share,
            f"{evidence.beside_share:.1%} of the points lie just beside the model, where nothing sends light back: "
            "the pose may be wrong, or something else stands there.",
        )
    if evidence.misfit_mm > settings.misfit_caution_share * tolerance.target_mm:
        yield _Finding(
            evidence.misfit_mm > settings.misfit_fail_share * tolerance.target_mm,
            evidence.misfit_mm / (settings.misfit_caution_share * tolerance.target_mm),
            f"Whole patches of points lie {evidence.misfit_mm:.2f} mm (rms) off the model, which noise cannot do: "
            "another bone, a mirrored or poorly segmented model, or tissue taken for bone.",
        )


def _about_search(evidence: Evidence, settings: TrustSettings) -> Iterator[_Finding]:
    """Other poses that may be the truth: not met often enough, named, unseen, or wanted by a half of the points."""
    if not evidence.confident:
        yield _Finding(
            False, 1.0, "The search reached this pose only once: a better one may have been missed; give landmarks."
        )
    if evidence.rivals:
        nearest = evidence.rivals[0]
        yield _Finding(
            False,
            2.0,
            f"{len(evidence.rivals)} other pose(s) explain the points nearly as well; the best of them is "
            f"{nearest.rotation_deg:.1f} deg and {nearest.translation_mm:.1f} mm away.",
        )
    if evidence.halves > settings.max_halves and evidence.halves_off > settings.max_halves_off:
        yield _Finding(
            False,
            evidence.halves / settings.max_halves,
            f"Two halves of the scan, registered apart, differ by {evidence.halves:.1f} times what noise allows: "
            "the model differs from the bone, tissue was taken for bone, or something moved.",
        )


def _about_size(evidence: Evidence, tolerance: Tolerance, settings: TrustSettings) -> Iterator[_Finding]:
    """Predicted errors beyond their limits."""
    for predicted in _predicted(evidence, tolerance, settings):
        if predicted.value > predicted.limit:
            yield _Finding(predicted.fails(settings), predicted.value / predicted.limit, predicted.sentence)
    if evidence.beyond_probability > settings.max_beyond:
        yield _Finding(
            False,
            evidence.beyond_probability / settings.max_beyond,
            f"The rotation is beyond {tolerance.rotation_deg:g} deg with a probability of "
            f"{evidence.beyond_probability:.1%}, {settings.max_beyond:.1%} is allowed: scan more, or give landmarks.",
        )


LOOK_ALIKE = 0.5
"""Errors that the points show half as clearly as the clearest may be what is wrong just as well."""

REMEDIES = {
    "model offset": "the surface lies {value:+.2f} mm too far out: check the threshold, or state --model-offset-mm",
    "model scale": "the model is {percent:+.2f} % too large: check the CT's scale, or state it in the budget",
    "mirror scale": "mirror angles are {percent:+.2f} % too large: calibrate (picoradar bench geometry), or state it",
    "walk": "ranges grow by {value:+.2f} mm at 60 deg of incidence: calibrate the ranging, or state it in the budget",
}


def _beyond_budget(evidence: Evidence, tolerance: Tolerance, settings: TrustSettings) -> Iterator[_Finding]:
    """What the points show of errors that the budget does not hold; of several that look alike, the clearest."""
    counts = [one for one in evidence.shown if one.shift_mm > settings.shown_share * tolerance.target_mm]
    if counts:
        clearness = {one.name: abs(one.value) / one.sd for one in counts}
        alike = [one for one in counts if clearness[one.name] >= LOOK_ALIKE * max(clearness.values())]
        alike.sort(key=lambda one: -clearness[one.name])
        said = "; or ".join(REMEDIES[one.name].format(value=one.value, percent=100.0 * one.value) for one in alike)
        shift_mm = max(one.shift_mm for one in alike)
        yield _Finding(
            False,
            shift_mm / (settings.shown_share * tolerance.target_mm),
            f"The points look as if {said} (a target moves by up to {shift_mm:.2f} mm).",
        )


@dataclass(frozen=True)
class _Predicted:
    """A predicted error (95 %) beside its limit; beyond `free`, nothing holds the motion."""

    what: str
    value: float
    limit: float
    unit: str
    free: float
    by_range_error: bool = False

    def fails(self, settings: TrustSettings) -> bool:
        """Whether it is too large even for a caution."""
        return self.value > self.free or self.value > settings.fail_factor * self.limit

    @property
    def sentence(self) -> str:
        """What is wrong with it, and what to do."""
        if self.value > self.free:
            return f"The points leave the {self.what} free: scan a region with more shape, or more of the bone."
        remedy = "most of it a common range error: measure the material again, on a sample more like it"
        return (
            f"The predicted {self.what} reaches {self.value:.2f} {self.unit} (95 %), the limit is {self.limit:g} "
            f"{self.unit}: {remedy if self.by_range_error else 'scan more'}."
        )


def _predicted(evidence: Evidence, tolerance: Tolerance, settings: TrustSettings) -> list[_Predicted]:
    rotation_deg = settings.rotation_sds * evidence.rotation_sd_deg
    errors = [_Predicted("rotation", rotation_deg, tolerance.rotation_deg, "deg", settings.free_rotation_deg)]
    for target in evidence.targets:
        value = target.stated_mm if evidence.range_error_known else target.p95_mm
        mostly = value - target.p95_mm > target.p95_mm
        what = f"error at {target.name}"
        errors.append(_Predicted(what, value, tolerance.target_mm, "mm", settings.free_target_mm, mostly))
    return errors
