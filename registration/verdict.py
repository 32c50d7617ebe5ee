"""The verdict: from predicted errors, rivals and physics, never from the size of the residuals alone."""

from __future__ import annotations

from dataclasses import dataclass

from registration.quality import Target
from registration.result import Rival, Verdict


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
        Share of points significantly inside bone, where no beam can end.
    chi2 : float
        Mean squared residual of the inliers in units of their predicted sigma.
    noise_mm, noise_limit_mm : float
        Range noise that the residuals show, and the most that the instrument can have.
    rivals : list of Rival
    """

    rotation_sd_deg: float
    targets: list[Target]
    points: int
    inliers: int
    inside_share: float
    noise_mm: float
    noise_limit_mm: float
    rivals: list[Rival]


def judge(evidence: Evidence, tolerance: Tolerance) -> tuple[Verdict, list[str]]:
    """Return the verdict and its reasons as sentences."""
    fails: list[str] = []
    cautions: list[str] = []
    share = evidence.inliers / evidence.points
    if share < 0.25:
        fails.append(f"Only {share:.0%} of the points lie on the model: it may be another bone, or the pose is wrong.")
    if evidence.inside_share > 0.10:
        fails.append(f"{evidence.inside_share:.0%} of the points lie inside bone, where no beam can end.")
    if evidence.noise_mm > evidence.noise_limit_mm:
        fails.append(
            f"The points scatter by {evidence.noise_mm:.2f} mm about the model, more than the instrument's noise can "
            f"explain ({evidence.noise_limit_mm:.2f} mm): another bone or a wrong pose."
        )
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
    worst = max((t.p95_mm for t in evidence.targets), default=0.0)
    return "pass", [
        f"Predicted rotation error {evidence.rotation_sd_deg:.2f} deg (rms); with 95 % probability the error at every "
        f"target is under {worst:.2f} mm."
    ]


def _judge_size(what: str, value: float, limit: float, unit: str, fails: list[str], cautions: list[str]) -> None:
    if value <= limit:
        return
    sentence = (
        f"The predicted {what} reaches {value:.2f} {unit} (95 %), the limit is {limit:g} {unit}: scan more of the bone."
    )
    (fails if not value <= 2.0 * limit else cautions).append(sentence)
