"""The front door: :func:`register`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy.typing as npt

from picoradar.registration.classic import DissertationSettings
from picoradar.registration.errors import RegistrationError
from picoradar.registration.model import Model
from picoradar.registration.refine import excluded_regions
from picoradar.registration.register.asked import (
    USUAL,
    budget_with,
    check_noise,
    check_targets,
    sockets_of,
    with_model_noise,
)
from picoradar.registration.register.landmarked import beside_landmarks
from picoradar.registration.register.work import Work
from picoradar.registration.scan import checked_scan, weighted_by_response
from picoradar.registration.search import Start, checked_start, landmarks_of
from picoradar.registration.settings import RobustSettings
from picoradar.registration.trust import (
    ErrorBudget,
    Objection,
    Registration,
    RegistrationRequest,
    TargetsLike,
    Tolerance,
)


def register(
    points: npt.ArrayLike,
    model: Model,
    *,
    start: Start = "any",
    origin: npt.ArrayLike = (0.0, 0.0, 0.0),
    covariance: npt.ArrayLike | None = None,
    response_mv: npt.ArrayLike | None = None,
    grid: npt.ArrayLike | None = None,
    method: Literal["robust", "dissertation"] = "robust",
    targets: TargetsLike = None,
    noise_mm: float | None = None,
    range_bias_mm: float | None = None,
    sigma_model_mm: float | None = None,
    model_offset_mm: float | None = None,
    budget: ErrorBudget | None = None,
    exclude: Sequence[Mapping[str, Any]] | None = None,
    tolerance: Tolerance | None = None,
    objections: Sequence[Objection] = (),
    settings: RobustSettings | DissertationSettings | None = None,
) -> Registration:
    """Register measured points to a model.

    Parameters
    ----------
    points : (N, 3) array
        Scanner frame, mm, N at least 6.
    model : Model
        From :func:`registration.prepare_model` or :func:`registration.load_model`.
    start : "any", Cone or dict, (4, 4) array, Landmarks or list of dicts
        Where to start: anywhere; anywhere that the scanner looks from within a cone of directions
        ``{"towards": [x, y, z], "half_angle_deg": a}`` (from the model to the scanner, model frame, any roll); from a
        pose `model_from_scanner`; or from landmark pairs ``{"scanner": [x, y, z], "model": [x, y, z], "name": ...}``.
    origin : (3,) array
        Where the beams came from, scanner frame, mm.
    covariance : (N, 3, 3) array, optional
        Of the points, mm^2.
    response_mv : (N,) array, optional
        Amplitude of each echo at the photodiode. Points darker than bone take no part at the end, and without
        `covariance` weak echoes count for less.
    grid : (N, 2) array of int, optional
        Raster row and column of each point.
    method : {"robust", "dissertation"}
        "dissertation" is the ICP of its section 3.3 with outlier elimination and minima suppression; it needs a start.
    targets : (M, 3) array or list of dicts, optional
        Points of the model frame where the error matters, mm; dicts hold "position" and "name".
    noise_mm : float, optional
        Range noise of a point, 0.001 to 100 mm; estimated from the residuals when not given.
    range_bias_mm : float, optional
        Standard deviation of a range error common to all points, which leaves no trace in the residuals, up to 100 mm:
        of range zero and material, as the radar's calibration has it. Not given, it counts as never measured, and
        the verdict is a caution at best.
    sigma_model_mm : float, optional
        Standard deviation of the model's surface along its normal: a random field over the surface. 0.02 mm when not
        given, which facets have; of a surface from a CT of 1 mm about 0.1.
    model_offset_mm : float, optional
        Standard deviation of the model being too large or too small all over, as by the threshold of a CT. What the
        points show of it is taken into the pose. Nothing when not given: what shows then makes the verdict a caution.
    budget : ErrorBudget, optional
        All errors of instrument and model that leave no trace in the residuals, or too little of one; the three above
        have precedence.
    exclude : list of dicts, optional
        Regions of the model that take no part: ``{"center": [x, y, z], "radius_mm": r}``, model frame.
    tolerance : Tolerance, optional
        Limits of the verdict, 1 deg and 1 mm when not given.
    objections : sequence of Objection, optional
        What speaks against the points and does not show in them: the verdict is a caution at best, or a fail.
    settings : RobustSettings or DissertationSettings, optional
        Parameters of the method.

    Raises
    ------
    RegistrationError
        One of its family (points, start, degenerate geometry), saying what was found and what to do.

    Examples
    --------
    Three sides of a wedge, seen from above; the scanner's frame is the model's, moved by (5, -3, 800) mm.

    >>> import numpy as np
    >>> from picoradar import prepare_model, register
    >>> corners = np.array([[0.0, 0, 0], [60, 0, 0], [0, 40, 0], [10, 10, 50]])
    >>> sides = [[0, 1, 3], [1, 2, 3], [2, 0, 3]]
    >>> model = prepare_model(corners, [[0, 2, 1], *sides])
    >>> shares = np.random.default_rng(1).dirichlet(np.ones(3), size=(3, 150))
    >>> points = np.einsum("fnk,fkd->fnd", shares, corners[sides]).reshape(-1, 3) + [5, -3, 800]
    >>> start = np.eye(4)
    >>> start[:3, 3] = [-4, 2, -799]
    >>> found = register(points, model, start=start, origin=[25, -100, 2000], range_bias_mm=0.1)
    >>> found.verdict
    'pass'
    >>> np.abs(found.model_from_scanner[:3, 3] - [-5, 3, -800]).max() < 0.01
    np.True_
    """
    scan = checked_scan(points, origin=origin, covariance=covariance, response_mv=response_mv, grid=grid)
    check_noise(noise_mm)
    check_targets(targets)
    known = budget_with(budget, range_bias_mm, sigma_model_mm, model_offset_mm)
    robust = with_model_noise(settings if isinstance(settings, RobustSettings) else USUAL, known)
    if scan.covariance is None and scan.response_mv is not None:
        scan = weighted_by_response(scan, noise_mm, robust.noise)
    request = RegistrationRequest(targets, tolerance or Tolerance(), known, objections, sockets_of(model))
    work = Work(scan, model, noise_mm, excluded_regions(exclude), request, method, settings, robust)
    if (marks := landmarks_of(start)) is None or method != "robust":
        return work.registered(checked_start(start))
    found: Registration | RegistrationError
    try:
        found = work.registered(checked_start(start))
    except RegistrationError as error:
        found = error
    return beside_landmarks(found, marks, lambda: work.registered(None))
