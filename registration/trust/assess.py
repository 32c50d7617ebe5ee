"""Turns a solved pose into a :class:`Registration`: measures, covariance, predicted errors, verdict.

Equation numbers are those of ``docs/registration.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray
from picoradar.registration.errors import RegistrationError
from picoradar.registration.scan import Scan
from picoradar.registration.se3 import displacement_covariance, orthonormalised, small_motion
from picoradar.registration.settings import RobustSettings, TrustSettings
from picoradar.registration.solution import Solution, residual_measures
from picoradar.registration.trust.budget import ErrorBudget, Socket
from picoradar.registration.trust.checks import checks_of
from picoradar.registration.trust.covariance import Target
from picoradar.registration.trust.evidence import Evidence, Objection, ShownError, Tolerance
from picoradar.registration.trust.fit import Assessed, Known
from picoradar.registration.trust.minima import (
    minima_of,
    plausible_rivals,
    rivals_as_ends,
    shift_at,
    unseen_probability,
)
from picoradar.registration.trust.mixture import Mixture
from picoradar.registration.trust.result import Registration
from picoradar.registration.trust.verdict import judge
from picoradar.registration.trust.words import weak_directions

TargetsLike: TypeAlias = npt.ArrayLike | Sequence[dict[str, Any]] | None
"""Points (M, 3) of the model frame, or dicts with "position" and "name"."""


@dataclass(frozen=True)
class RegistrationRequest:
    """What the caller asks, and knows beforehand.

    Attributes
    ----------
    targets : (M, 3) array, list of dicts or None
        Where the error matters.
    tolerance : Tolerance
        How large it may be.
    budget : ErrorBudget
        Errors that the points do not show, or not well.
    objections : sequence of Objection
        What speaks against the points.
    sockets : sequence of Socket
        Of the model.
    taken : mapping of name to float
        Errors of the budget that were taken off the points already.
    """

    targets: TargetsLike
    tolerance: Tolerance
    budget: ErrorBudget = field(default_factory=ErrorBudget)
    objections: Sequence[Objection] = ()
    sockets: Sequence[Socket] = ()
    taken: Mapping[str, float] = field(default_factory=dict)

    @property
    def known(self) -> Known:
        """What is known beside the points."""
        return Known(self.budget, self.sockets, self.taken)


def assess(
    scan: Scan,
    solution: Solution,
    request: RegistrationRequest,
    findings: list[str],
    settings: RobustSettings,
    *,
    fit: Assessed | None = None,
) -> Registration:
    """Measure, predict and judge a solution, moved by what the points show of the budget's errors.

    Parameters
    ----------
    scan : Scan
    solution : Solution
    request : RegistrationRequest
    findings : list of sentences
        What validation of the model found.
    settings : RobustSettings
    fit : Assessed, optional
        Of this solution, where it was reckoned already.
    """
    fit = fit or Assessed.of(scan, solution, request.known, settings.trust)
    pose = orthonormalised(small_motion(fit.motion, fit.centre) @ solution.model_from_scanner)
    residuals = solution.closest.signed_mm.copy()
    residuals[fit.points.at] += fit.points.rows @ fit.motion
    unseen = unseen_probability(fit, settings.trust)
    independent = min(len(scan), settings.tissue.independent_points)
    rivals = plausible_rivals(solution, independent, settings.trust)
    places = named_targets(request.targets, fit.centre)
    near = minima_of(solution, fit, [(end.model_from_scanner, end.weight) for end in solution.alternatives])
    far = minima_of(solution, fit, rivals_as_ends(rivals, solution, independent, fit.centre, settings))
    predict = partial(predicted, fit=fit, budget=request.budget, unseen=unseen, settings=settings.trust)
    targets = [predict(name, position, [*near, *far]) for name, position in places]
    checks = checks_of(scan, solution, fit, targets, request.sockets)
    turns = [] if solution.edges else [(x[:3], weight) for x, weight in near]  # along edges these are no minima
    turn = Mixture(fit.own[:3, :3], turns, unseen, settings.trust.unseen_sds)
    evidence = replace(
        _evidence(scan, solution, fit, request, settings),
        targets=[predict(name, position, near) for name, position in places] if far else targets,
        rivals=rivals,
        halves=checks.halves,
        halves_off=checks.halves_off(request.tolerance),
        beyond_probability=turn.beyond(float(np.radians(request.tolerance.rotation_deg))),
    )
    verdict, reasons = judge(evidence, request.tolerance, settings.trust)
    measures = residual_measures(residuals[fit.used])
    return Registration(
        model_from_scanner=pose,
        covariance=fit.covariance,
        centre=fit.centre,
        verdict=verdict,
        reasons=reasons,
        inliers=solution.inliers,
        residuals=residuals,
        rms_mm=measures.rms_mm,
        mean_mm=measures.mean_mm,
        max_mm=measures.max_mm,
        nlse=measures.nlse,
        targets=targets,
        predicted_rotation_deg=evidence.rotation_sd_deg,
        weak_directions=weak_directions(fit, request.tolerance, request.sockets),
        rivals=solution.rivals,
        history=solution.history,
        cost=solution.cost,
        method=solution.method,
        noise_mm=solution.noise.range_mm,
        misfit_mm=fit.misfit_mm,
        findings=findings,
        miss_probability=unseen,
        checks=checks,
    )


def _evidence(
    scan: Scan, solution: Solution, fit: Assessed, request: RegistrationRequest, settings: RobustSettings
) -> Evidence:
    trust = settings.trust
    deep_inside = -trust.inside_sigmas * np.maximum(fit.sigma, trust.inside_min_sigma_mm)
    places = [position for _, position in named_targets(request.targets, fit.centre)]
    return Evidence(
        rotation_sd_deg=min(180.0, float(np.degrees(np.sqrt(np.trace(fit.covariance[:3, :3]))))),
        targets=[],
        points=len(scan),
        inliers=int(solution.inliers.sum()),
        inside_share=float(np.mean(solution.closest.signed_mm < deep_inside)),
        beside_share=solution.beside_share,
        misfit_mm=fit.misfit_mm,
        rivals=[],
        confident=solution.confident,
        range_error_known=request.budget.range_bias_mm is not None,
        objections=request.objections,
        shown=[
            ShownError(
                one.name,
                one.value,
                one.sd,
                max(float(np.linalg.norm(shift_at(one.motion, p, fit.centre))) for p in places),
            )
            for one in fit.shown
            if places and not solution.edges  # beside edges the pose does not follow in proportion
        ],
    )


def predicted(
    name: str,
    position: FloatArray,
    others: Sequence[tuple[FloatArray, float]],
    *,
    fit: Assessed,
    budget: ErrorBudget,
    unseen: float,
    settings: TrustSettings,
) -> Target:
    """Predict the error at one target [eq. 12, 15, 16].

    The model's scale moves it, too: it counts about the target itself, since nobody knows about which point a CT is
    too large.
    """
    shifts = {error: shift_at(motion, position, fit.centre) for error, motion in fit.biases.items()}
    if "model scale" in shifts:
        shifts["model scale"] = shifts["model scale"] + budget.model_scale * (fit.centre - position)
    parts = {error: float(np.linalg.norm(shift)) for error, shift in shifts.items()}
    bias_mm = math.nan if budget.range_bias_mm is None else math.sqrt(sum(part**2 for part in parts.values()))
    shifted = [(shift_at(motion, position, fit.centre), weight) for motion, weight in others]
    mixture = Mixture(displacement_covariance(fit.own, position - fit.centre), shifted, unseen, settings.unseen_sds)
    p95_mm = mixture.quantile()
    return Target(name, position, mixture.rms(), p95_mm, bias_mm, p95_mm + settings.bias_sds * bias_mm, parts)


def named_targets(targets: TargetsLike, centre: FloatArray) -> list[tuple[str, FloatArray]]:
    """Names and positions; without targets, the centre of the registered cloud stands in.

    Raises
    ------
    RegistrationError
        If targets are neither (M, 3) nor dicts with "position".
    """
    if targets is None:
        return [("centre of the cloud", centre)]
    if isinstance(targets, Sequence) and len(targets) > 0 and isinstance(targets[0], dict):
        try:
            return [
                (str(t.get("name", f"target {i + 1}")), np.asarray(t["position"], dtype=np.float64).reshape(3))
                for i, t in enumerate(targets)
            ]
        except (KeyError, TypeError, ValueError) as error:
            raise RegistrationError(
                f'a target is a dict with "position": [x, y, z] in mm and "name" ({error})'
            ) from error
    positions = np.asarray(targets, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3 or not np.isfinite(positions).all():
        raise RegistrationError(f"targets have shape {positions.shape}: give finite (M, 3) in the model frame, mm")
    return [(f"target {i + 1}", p) for i, p in enumerate(positions)]
