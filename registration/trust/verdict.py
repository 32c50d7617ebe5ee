"""The verdict: from predicted errors, rivals and physics, never from the size of the residuals alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from picoradar.registration.settings import TrustSettings
from picoradar.registration.solution import Rival
from picoradar.registration.trust.covariance import Target
from picoradar.registration.trust.result import Verdict

UNKNOWN_RANGE_ERROR = (
    "How far all ranges are off together was never measured on this material, and it leaves no trace in the "
    "residuals: bone reads millimetres too far. Measure it on a sample (picoradar bench penetration --material bone), "
    "scan with that calibration and --material bone; or state what is left of it (--range-bias-mm)."
)


@dataclass(frozen=True)
class Tolerance:
    """What the clinic asks for (dissertation: 1 deg and 1 mm)."""

    rotation_deg: float = 1.0
    target_mm: float = 1.0


@dataclass(frozen=True)
class Objection:
    """What speaks against the points as a whole, and does not show in them: told by whoever measured them.

    Attributes
    ----------
    sentence : str
        What is wrong, and what to do.
    fails : bool
        Whether the pose must not be used; else the verdict is a caution at best.
    """

    sentence: str
    fails: bool = False


@dataclass(frozen=True)
class Evidence:
    """What the verdict is drawn from.

    Attributes
    ----------
    rotation_sd_deg : float
        Predicted, total over three axes.
    targets : list of Target
    points, inliers : int
    inside_share : float
        Share of points clearly inside bone, where no beam can end.
    beside_share : float
        Share of points just beside a closed model, whose beams pass it by.
    misfit_mm : float
        Departure of the model from the points that neighbours share.
    rivals : list of Rival
        Those that may be the truth.
    confident : bool
        The search reached this minimum often enough to trust that it missed no better one.
    range_error_known : bool
        How large a range error common to all points may be was measured.
    objections : sequence of Objection
        Of those who measured the points.
    """

    rotation_sd_deg: float
    targets: list[Target]
    points: int
    inliers: int
    inside_share: float
    beside_share: float
    misfit_mm: float
    rivals: list[Rival]
    confident: bool
    range_error_known: bool
    objections: Sequence[Objection] = ()


def judge(evidence: Evidence, tolerance: Tolerance, settings: TrustSettings) -> tuple[Verdict, list[str]]:
    """Return the verdict and its reasons as sentences."""
    fails: list[str] = []
    cautions: list[str] = []
    share = evidence.inliers / evidence.points
    if share < settings.min_inlier_share:
        fails.append(f"Only {share:.0%} of the points lie on the model: it may be another bone, or the pose is wrong.")
    if evidence.inside_share > settings.inside_caution_share:
        (fails if evidence.inside_share > settings.inside_fail_share else cautions).append(
            f"{evidence.inside_share:.1%} of the points lie inside bone, where no beam can end: the model may be "
            "another bone, or mirrored."
        )
    if evidence.beside_share > settings.beside_caution_share:
        cautions.append(
            f"{evidence.beside_share:.1%} of the points lie just beside the model, where nothing sends light back: "
            "the pose may be wrong, or something else stands there."
        )
    if evidence.misfit_mm > settings.misfit_caution_share * tolerance.target_mm:
        (fails if evidence.misfit_mm > settings.misfit_fail_share * tolerance.target_mm else cautions).append(
            f"Whole patches of points lie {evidence.misfit_mm:.2f} mm (rms) off the model, which noise cannot do: "
            "another bone, a mirrored or poorly segmented model, or tissue taken for bone."
        )
    if not evidence.confident:
        cautions.append("The search reached this pose only once: a better one may have been missed; give landmarks.")
    for predicted in _predicted(evidence, tolerance, settings):
        if predicted.value > predicted.limit:
            (fails if predicted.fails(settings) else cautions).append(predicted.sentence)
    if not evidence.range_error_known:
        cautions.append(UNKNOWN_RANGE_ERROR)
    for objection in evidence.objections:
        (fails if objection.fails else cautions).append(objection.sentence)
    if evidence.rivals:
        nearest = evidence.rivals[0]
        cautions.append(
            f"{len(evidence.rivals)} other pose(s) explain the points nearly as well; the best of them is "
            f"{nearest.rotation_deg:.1f} deg and {nearest.translation_mm:.1f} mm away."
        )
    if fails:
        return "fail", fails + cautions
    if cautions:
        return "caution", cautions
    worst = max((t.stated_mm for t in evidence.targets), default=0.0)
    return "pass", [
        f"Predicted rotation error {evidence.rotation_sd_deg:.2f} deg (rms); with 95 % probability the error at every "
        f"target is under {worst:.2f} mm, a common range error included."
    ]


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
