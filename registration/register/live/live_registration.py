"""`LiveRegistration`: from nothing known to a pose as soon as the points allow, then a better one after every line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np

from picoradar.registration._types import BoolArray
from picoradar.registration.errors import RegistrationError
from picoradar.registration.model import Model
from picoradar.registration.refine import excluded_regions
from picoradar.registration.register.asked import USUAL, check_noise, check_targets, sockets_of
from picoradar.registration.register.batch import register
from picoradar.registration.register.live.cloud import GrowingCloud
from picoradar.registration.register.live.line import MeasuredLine
from picoradar.registration.register.live.options import RegisterOptions, budget_of, settings_of
from picoradar.registration.register.live.readiness import what_is_lacking
from picoradar.registration.register.live.result import LiveResult, Stage
from picoradar.registration.register.live.tracking import Tracker
from picoradar.registration.scan import Scan
from picoradar.registration.search import checked_start
from picoradar.registration.settings import LiveSettings
from picoradar.registration.solution import Solution
from picoradar.registration.trust import Objection, Registration, RegistrationRequest, Tolerance
from picoradar.registration.trust.assess import assess


class LiveRegistration:
    """Registers a scan while it is being made.

    Until there is a pose, cheap tests say whether a search is worth while; it is that of :func:`registration.register`.
    Then every line refines the last pose (`Tracker`), at most a tenth of the time of a search. The pose is looked for
    anew when new lines no longer lie on the model, when a rival has become the likelier one, or when the verdict fails.
    `confirm` registers all points from scratch: what is decided upon a live pose is decided upon that.

    Calls come from one thread; `result` may be read from any.

    Parameters
    ----------
    model : Model
    live : LiveSettings, optional
    **options : RegisterOptions
        As for :func:`registration.register`.

    Raises
    ------
    RegistrationError
        As `register`, for options that cannot be used.

    Examples
    --------
    Three sides of a wedge, as in the example of `register`, 30 points a line; nothing is known of the pose.

    >>> import numpy as np
    >>> from picoradar import prepare_model
    >>> from picoradar.registration.live import Line, LiveRegistration
    >>> corners = np.array([[0.0, 0, 0], [60, 0, 0], [0, 40, 0], [10, 10, 50]])
    >>> sides = [[0, 1, 3], [1, 2, 3], [2, 0, 3]]
    >>> model = prepare_model(corners, [[0, 2, 1], *sides])
    >>> shares = np.random.default_rng(1).dirichlet(np.ones(3), size=(3, 150))
    >>> points = np.einsum("fnk,fkd->fnd", shares, corners[sides]).reshape(-1, 3) + [5, -3, 800]
    >>> live = LiveRegistration(model, origin=[25, -100, 2000], range_bias_mm=0.1)
    >>> for row in range(15):
    ...     found = live.add(Line(row, np.arange(30), points[row::15]))
    ...     print(live.result.points, live.result.verdict) if row in (0, 14) else None
    30 None
    450 pass
    >>> np.abs(live.confirm().model_from_scanner[:3, 3] - [-5, 3, -800]).max() < 0.01
    np.True_
    """

    def __init__(self, model: Model, *, live: LiveSettings | None = None, **options: Unpack[RegisterOptions]) -> None:
        check_noise(options.get("noise_mm"))
        check_targets(options.get("targets"))
        self._model, self._options, self._live = model, options, live or LiveSettings()
        self._budget, self._settings = budget_of(options), settings_of(options, USUAL)
        self._tracker = Tracker(
            model,
            checked_start(options.get("start", "any")),
            options.get("noise_mm"),
            excluded_regions(options.get("exclude")),
            self._settings,
            self._live,
        )
        self._cloud = GrowingCloud(options.get("origin", (0.0, 0.0, 0.0)))
        self._solution: Solution | None = None
        self._searched_at = self._unexplained = self._steady = 0
        self._confirmed_at = self._followed_at = self._walked_at = 0
        self._bright = np.empty(0, dtype=np.bool_)
        self._growth = self._live.retry_growth
        self._result = LiveResult()

    @property
    def result(self) -> LiveResult:
        """Get what the lines so far say."""
        return self._result

    def add(self, line: MeasuredLine) -> Registration | None:
        """Take a line in; returns the registration of the lines so far, None until a pose is possible.

        Raises
        ------
        PointsError
            When the line cannot be used; what was known before stays.
        """
        fresh = self._cloud.add(line)
        if self._solution is not None:
            self._follow(self._solution, fresh)
        elif lacking := what_is_lacking(self._cloud.points, self._live):
            self._keep("waiting", lacking, None)
        elif self._may_search(self._live.retry_growth):
            self._search("")
        else:
            self._keep("waiting", self._result.why, self._result.registration)
        self._steady = self._steady + 1 if self._result.verdict == "pass" else 0
        return self._result.registration

    def reaches(self, until_tre_mm: float | None = None) -> bool:
        """Get whether the goal of `LiveResult.reaches` is reached beyond a lucky look: for several lines in a row, and
        also when all points are registered from scratch, which is tried now and again."""
        if self._steady < self._live.steady_lines or not self._result.reaches(until_tre_mm):
            return False
        if len(self._cloud) < self._live.retry_growth * self._confirmed_at:
            return False
        return self.confirm().reaches(until_tre_mm)

    def confirm(self, objections: Sequence[Objection] | None = None) -> LiveResult:
        """Register all points so far as `register` does, with full trust, and go on from that pose.

        Parameters
        ----------
        objections : sequence of Objection, optional
            What speaks against the points by now; as given before when left out.
        """
        cloud, options = self._cloud, self._options.copy()
        if objections is not None:
            options["objections"] = objections
        self._confirmed_at = len(cloud)
        try:
            found = register(
                cloud.points,
                self._model,
                covariance=cloud.covariance,
                response_mv=cloud.response_mv,
                grid=cloud.grid,
                **options,
            )
        except RegistrationError as error:
            self._solution = None
            self._keep("waiting", str(error), None)
            return self._result
        if self._solution is not None:
            self._solution = _from_there(self._solution, found)
        self._keep("confirmed", "", found)
        return self._result

    # ---- with a pose

    def _follow(self, before: Solution, fresh: int) -> None:
        """Refine the pose, where the points have become enough more for that; and see whether the last line fits it."""
        self._bright = np.append(self._bright, np.ones(fresh, dtype=np.bool_))
        last = np.zeros(len(self._cloud), dtype=np.bool_)
        last[len(last) - fresh :] = True
        if len(self._cloud) >= self._live.follow_growth * self._followed_at:
            self._refine(before, last)
            return
        self._keep("followed", "", self._result.registration)
        if fresh > 0:
            scan = self._tracker.weighted(self._cloud.scan(last))
            self._note_explained(self._tracker.explained(scan, before), before.inliers)

    def _refine(self, before: Solution, last: BoolArray) -> None:
        """Refine the pose with all points, `last` (N,) those of the last line."""
        cloud, tracker = self._cloud, self._tracker
        chosen = cloud.part(self._live.followed_points)
        scan = tracker.weighted(cloud.scan(chosen))
        walk = len(cloud) >= self._live.walk_growth * self._walked_at
        solution = tracker.followed(scan, before, self._bright[chosen], walk=walk)
        solution = tracker.watched(scan, solution, len(cloud.lines))
        self._bright[chosen] = tracker.bright(scan, solution)
        self._followed_at, self._walked_at = len(cloud), len(cloud) if walk else self._walked_at
        if last[chosen].any():
            on = solution.inliers
            self._note_explained(float(on[last[chosen]].mean()), on[~last[chosen]])
        self._solution, found = solution, self._assessed(scan, solution)
        self._keep("followed", "", found)
        if doubt := self._doubt(solution, found):
            self._search(doubt)

    def _note_explained(self, share: float, before: BoolArray) -> None:
        """Count the lines in a row of whose points a smaller share lies on the model than of the points before."""
        unlike = share < self._live.least_explained * float(before.mean())
        self._unexplained = self._unexplained + 1 if unlike else 0

    def _doubt(self, solution: Solution, found: Registration) -> str:
        """Say why the pose is to be looked for anew now; empty when it is not."""
        if not self._may_search(self._live.retry_growth):
            return ""
        if any(rival.cost < solution.cost for rival in solution.rivals):
            return "another pose has become the likelier one"
        if self._unexplained >= self._live.unexplained_lines:
            return "the last lines do not lie on the model"
        return (
            f"the pose fails: {found.reasons[0]}" if found.verdict == "fail" and self._may_search(self._growth) else ""
        )

    # ---- without one

    def _may_search(self, growth: float) -> bool:
        return len(self._cloud) >= growth * self._searched_at

    def _search(self, why: str) -> None:
        """Look for the pose, anew where one is known."""
        scan = self._tracker.weighted(self._cloud.scan())
        self._searched_at, self._unexplained, before = len(scan), 0, self._solution
        try:
            solution = self._tracker.searched(scan)
        except RegistrationError as error:
            self._solution = None
            self._keep("waiting", str(error), None, searches=1)
            return
        again = before is not None and self._tracker.same(before, solution, scan)
        self._growth = self._live.again_growth if again else self._live.retry_growth
        self._solution, self._followed_at, self._walked_at = solution, len(scan), len(scan)
        self._bright = self._tracker.bright(scan, solution)
        self._keep("searched", why, self._assessed(scan, solution), searches=1)

    def _assessed(self, scan: Scan, solution: Solution) -> Registration:
        options = self._options
        request = RegistrationRequest(
            options.get("targets"),
            options.get("tolerance") or Tolerance(),
            self._budget,
            options.get("objections", ()),
            sockets_of(self._model),
        )
        return assess(scan, solution, request, list(self._model.report.findings), self._settings)

    def _keep(self, stage: Stage, why: str, found: Registration | None, *, searches: int = 0) -> None:
        cloud, before = self._cloud, self._result
        self._result = LiveResult(stage, why, cloud.lines, len(cloud), before.searches + searches, found)


def _from_there(solution: Solution, found: Registration) -> Solution:
    return replace(solution, model_from_scanner=found.model_from_scanner, rivals=found.rivals, cost=found.cost)
