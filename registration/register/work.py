"""`Work`: a registration that is asked for, solved and judged from any start."""

from __future__ import annotations

from dataclasses import dataclass, replace

from picoradar.registration._types import FloatArray
from picoradar.registration.classic import DissertationSettings, solve_as_dissertation
from picoradar.registration.errors import RegistrationError, StartError
from picoradar.registration.model import Model
from picoradar.registration.robust import fitted_again, register_robust, without_dark_points
from picoradar.registration.scan import Scan
from picoradar.registration.search import Cone
from picoradar.registration.settings import RobustSettings
from picoradar.registration.solution import Solution
from picoradar.registration.trust import (
    Assessed,
    Registration,
    RegistrationRequest,
    taken_off,
)
from picoradar.registration.trust.assess import assess


@dataclass(frozen=True)
class Work:
    """A registration that is asked for, but for where it starts."""

    scan: Scan
    model: Model
    noise_mm: float | None
    regions: FloatArray
    request: RegistrationRequest
    method: str
    settings: RobustSettings | DissertationSettings | None
    robust: RobustSettings

    def registered(self, begin: FloatArray | Cone | None) -> Registration:
        """Solve and judge."""
        scan, model, robust, request = self.scan, self.model, self.robust, self.request
        solution = self._solved(begin)
        fit = Assessed.of(scan, solution, request.known, robust.trust)
        for _ in range(robust.trust.max_refits if self.method == "robust" else 0):
            if (taken := taken_off(scan, solution, fit, request.known, robust.trust)) is None:
                break
            scan = scan.moved_along(taken[0])
            request = replace(request, taken=taken[1])
            noise_known = self.noise_mm is not None or scan.noise_known
            solution = fitted_again(scan, model, solution, self.regions, robust, noise_known=noise_known)
            fit = Assessed.of(scan, solution, request.known, robust.trust)
        return assess(scan, solution, request, list(model.report.findings), robust, fit=fit)

    def _solved(self, begin: FloatArray | Cone | None) -> Solution:
        scan, model, regions = self.scan, self.model, self.regions
        if self.method == "dissertation":
            return _as_dissertation(scan, model, begin, self.noise_mm, regions, self.settings)
        if self.method != "robust":
            raise RegistrationError(f"method is {self.method!r}: give 'robust' or 'dissertation'")
        if isinstance(self.settings, DissertationSettings):
            raise RegistrationError("method 'robust' takes RobustSettings, not those of the dissertation")
        solution = register_robust(scan, model, begin, self.noise_mm, regions, self.robust)
        return without_dark_points(scan, model, solution, regions, self.robust)


def _as_dissertation(
    scan: Scan,
    model: Model,
    start: FloatArray | Cone | None,
    noise_mm: float | None,
    regions: FloatArray,
    settings: RobustSettings | DissertationSettings | None,
) -> Solution:
    """The dissertation's method, which knows neither a search nor excluded regions."""
    if isinstance(settings, RobustSettings):
        raise RegistrationError("method 'dissertation' takes DissertationSettings, not those of the robust method")
    if start is None or isinstance(start, Cone):
        raise StartError("method 'dissertation' needs a start: landmarks or a 4x4 pose; method 'robust' does not")
    if len(regions) > 0:
        raise RegistrationError("method 'dissertation' knows no excluded regions: cut the points, or take 'robust'")
    return solve_as_dissertation(scan, model, start, noise_mm, settings)
