"""The result of a registration, as an object and as JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.solution import Iteration, Rival
from picoradar.registration.trust.checks import Checks
from picoradar.registration.trust.covariance import Target

CHECK_AGAIN_AFTER_S = 1800.0
"""Half an hour. No measured figure: Yaniv (Registration for orthopaedic interventions, 2015) asks for checks
"periodically during the intervention" and leaves the period open."""

Verdict = Literal["pass", "caution", "fail"]


@dataclass(frozen=True)
class Expiry:
    """Until when a verdict holds: it is about the bone, the scanner and the reference as they stood in the scan.

    Attributes
    ----------
    check_again_after_s : float
        After so long without a check at a point on the bone nothing is known of it any more.
    ends_with : tuple of sentences
        What ends it at once.
    """

    check_again_after_s: float = CHECK_AGAIN_AFTER_S
    ends_with: tuple[str, ...] = (
        "The reference or the scanner was moved or touched.",
        "The bone moved, or was cut where it was scanned.",
        "Another model or calibration is in force.",
    )

    def holds(self, since_check_s: float) -> bool:
        """Whether it still does so long after the scan, or the last check, when nothing ended it."""
        return since_check_s <= self.check_again_after_s


@dataclass(frozen=True)
class Registration:
    """A registered cloud and how far to trust it.

    Attributes
    ----------
    model_from_scanner : (4, 4) array
        Rigid pose, ``p_model = model_from_scanner @ p_scanner``, mm.
    covariance : (6, 6) array
        Of (rotation rad, translation mm), a small motion in the model frame about `centre`; a standard
        deviation of a metre means that the motion is free.
    centre : (3,) array
        Centroid of the registered inliers, model frame, mm.
    verdict : {"pass", "caution", "fail"}
        From predicted errors and rivals, never from the residuals' size alone.
    reasons : list of sentences
        Why.
    inliers : (N,) array of bool
        Points taken for bone.
    residuals : (N,) array
        Signed distances to the model in mm, positive outside bone (towards the scanner).
    rms_mm, mean_mm, max_mm, nlse : float
        Measures of section 3.4.1 of the dissertation over the inliers.
    targets : list of Target
    predicted_rotation_deg : float
        Root mean square rotation error predicted (total over three axes), 180 at most.
    weak_directions : list of sentences
        The motions that the data hold worst, worst first.
    rivals : list of Rival
    history : list of Iteration
        Convergence, one entry an iteration.
    cost : float
        Mean robust cost a point of the solution.
    method : str
    noise_mm : float
        Range noise that the residuals show.
    misfit_mm : float
        Departure of the model from the points that neighbouring points share.
    findings : list of sentences
        What validation of the model found.
    checks : Checks or None
        Figures that the judgement rests on.
    expiry : Expiry
        Until when the verdict holds.
    miss_probability : float
        Of a minimum beside the pose that no fit reached; the quantiles at the targets hold it.
    """

    model_from_scanner: FloatArray
    covariance: FloatArray
    centre: FloatArray
    verdict: Verdict
    reasons: list[str]
    inliers: BoolArray
    residuals: FloatArray
    rms_mm: float
    mean_mm: float
    max_mm: float
    nlse: float
    targets: list[Target]
    predicted_rotation_deg: float
    weak_directions: list[str]
    rivals: list[Rival]
    history: list[Iteration]
    cost: float
    method: str
    noise_mm: float
    misfit_mm: float
    findings: list[str] = field(default_factory=list)
    miss_probability: float = 0.0
    checks: Checks | None = None
    expiry: Expiry = Expiry()

    def to_dict(self) -> dict[str, Any]:
        """Return the contract of ``picoradar register`` as plain JSON types; what could not be had is None."""
        return {
            "model_from_scanner": self.model_from_scanner.tolist(),
            "verdict": self.verdict,
            "reasons": list(self.reasons),
            "rms_mm": _number(self.rms_mm),
            "mean_mm": _number(self.mean_mm),
            "max_mm": _number(self.max_mm),
            "nlse": _number(self.nlse),
            "inliers": int(self.inliers.sum()),
            "points": len(self.inliers),
            "targets": [
                {
                    "name": t.name,
                    "position": t.position.tolist(),
                    "rms_mm": _number(t.rms_mm),
                    "p95_mm": _number(t.p95_mm),
                    "bias_mm": _number(t.bias_mm),
                    "stated_mm": _number(t.stated_mm),
                    "bias_parts_mm": {name: _number(part) for name, part in t.bias_parts_mm.items()},
                }
                for t in self.targets
            ],
            "predicted_rotation_deg": _number(self.predicted_rotation_deg),
            "weak_directions": list(self.weak_directions),
            "rivals": [
                {
                    "model_from_scanner": r.model_from_scanner.tolist(),
                    "cost": _number(r.cost),
                    "rotation_deg": _number(r.rotation_deg),
                    "translation_mm": _number(r.translation_mm),
                }
                for r in self.rivals
            ],
            "method": self.method,
            "noise_mm": _number(self.noise_mm),
            "misfit_mm": _number(self.misfit_mm),
            "miss_probability": _number(self.miss_probability),
            "checks": None if self.checks is None else {n: _number(v) for n, v in vars(self.checks).items()},
            "expiry": {
                "check_again_after_s": self.expiry.check_again_after_s,
                "ends_with": list(self.expiry.ends_with),
            },
        }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
