"""The verdict: from predicted errors, rivals and physics, never from the size of the residuals alone."""

from __future__ import annotations

from dataclasses import dataclass

from picoradar.registration.solution import Rival
from picoradar.registration.trust.covariance import Target
from picoradar.registration.trust.result import Verdict


@dataclass(frozen=True)
class Tolerance:
    """What the clinic asks for (dissertation: 1 deg and 1 mm)."""

    rotation_deg: float = 1.0
    target_mm: float = 1.0


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
    misfit_mm : float
        Departure of the model from the points that neighbours share.
    rivals : list of Rival
        Those that may be the truth.
    sure : bool
        The search reached this minimum often enough to trust that it missed no better one.
    """

    rotation_sd_deg: float
    targets: list[Target]
    points: int
    inliers: int
    inside_share: float
    misfit_mm: float
    rivals: list[Rival]
    sure: bool


FREE = {"deg": 90.0, "mm": 100.0}
"""Predicted errors beyond these mean that nothing holds the motion."""

MIN_SHARE = 0.25
"""Fewer points on the model than this share are no registration."""

INSIDE_CAUTION, INSIDE_FAIL = 0.005, 0.03
"""Shares of points inside bone."""

MISFIT_CAUTION, MISFIT_FAIL = 0.15, 0.5
"""Departures of the model in patches, as shares of the tolerance at the targets."""


def judge(evidence: Evidence, tolerance: Tolerance) -> tuple[Verdict, list[str]]:
    """Return the verdict and its reasons as sentences."""
    fails: list[str] = []
    cautions: list[str] = []
    share = evidence.inliers / evidence.points
    if share < MIN_SHARE:
        fails.append(f"Only {share:.0%} of the points lie on the model: it may be another bone, or the pose is wrong.")
    if evidence.inside_share > INSIDE_CAUTION:
        (fails if evidence.inside_share > INSIDE_FAIL else cautions).append(
            f"{evidence.inside_share:.1%} of the points lie inside bone, where no beam can end: the model may be "
            "another bone, or mirrored."
        )
    if evidence.misfit_mm > MISFIT_CAUTION * tolerance.target_mm:
        (fails if evidence.misfit_mm > MISFIT_FAIL * tolerance.target_mm else cautions).append(
            f"Whole patches of points lie {evidence.misfit_mm:.2f} mm (rms) off the model, which noise cannot do: "
            "another bone, a mirrored or poorly segmented model, or tissue taken for bone."
        )
    if not evidence.sure:
        cautions.append("The search reached this pose only once: a better one may have been missed; give landmarks.")
    _judge_size("rotation", 2.0 * evidence.rotation_sd_deg, tolerance.rotation_deg, "deg", fails, cautions)
    for target in evidence.targets:
        _judge_size(
            f"error at {target.name}", target.p95_mm + target.bias_mm, tolerance.target_mm, "mm", fails, cautions
        )
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
    worst = max((t.p95_mm + t.bias_mm for t in evidence.targets), default=0.0)
    return "pass", [
        f"Predicted rotation error {evidence.rotation_sd_deg:.2f} deg (rms); with 95 % probability the error at every "
        f"target is under {worst:.2f} mm, a common range error included."
    ]


def _judge_size(what: str, value: float, limit: float, unit: str, fails: list[str], cautions: list[str]) -> None:
    if value <= limit:
        return
    if value > FREE[unit]:
        fails.append(f"The points leave the {what} free: scan a region with more shape, or more of the bone.")
        return
    sentence = f"The predicted {what} reaches {value:.2f} {unit} (95 %), the limit is {limit:g} {unit}: scan more."
    (fails if value > 2.0 * limit else cautions).append(sentence)
