"""The result of a registration, as an object and as JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from picoradar.registration._types import BoolArray, FloatArray
from picoradar.registration.solution import Iteration, Rival
from picoradar.registration.trust.covariance import Target

Verdict = Literal["pass", "caution", "fail"]


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
        }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
