"""`PlanSettings` and `cheapest_windows`: just enough shots for the wanted uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picoradar.drivers.traces import Window
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.errors import BadInput
from picoradar.instrument.ranging.windows.fit import promised_sd_mm
from picoradar.instrument.settings import MIN_DISTANCE


@dataclass(frozen=True)
class PlanSettings:
    """What the planner aims at.

    Attributes
    ----------
    wanted_sd_mm : float
        Standard deviation that each range is to have.
    nearest_mm, farthest_mm : float
        Where echoes are looked for: the working range, and some room behind it for what stands behind the target.
    settle_shots : int
        Shots that the device throws away before each sweep; they count as cost.
    steps_ps : tuple of floats
        Steps to choose from, coarse to fine.
    sweeps : tuple of ints
        Numbers of sweeps to choose from, rising. One step and one number make the shots fixed.
    shared_reference : bool
        Whether the ranges of a line will share their reference; a few shots on it are then enough.
    first_response_mv : float
        Response to plan for while none has been seen.
    free_shots : int
        Shots on the reference that cost no time, because the mirrors settle meanwhile.
    foot_ps, top_ps : float
        Part of a pulse (ps) that a window must hold, before and behind its 50 % point: from before the rise to behind
        the peak.
    coarsest_ps : float
        Coarsest step (ps): with a fifth of the rise time, edges still have five samples.
    margins_ps : tuple of floats
        Margins (ps) to choose from, rising: 30 ps are 4.5 mm. An echo less sure than the last one is searched in the
        whole working range.
    reference_margin_ps : float
        Of the reference (ps), which moves with the temperature of the laser diode alone.
    min_response_mv : float
        Weakest response (mV) that is planned for; a weaker one would take the shots of many others.
    monitor_sd_share : float
        Share of ``wanted_sd_mm`` that a point which is monitored for motion is measured to.
    mark_sd_mm : float
        Standard deviation that the zero mark is measured to.
    neighbours, dropped_share : int, float
        An echo is suspected below that share of the median response of so many points to either side.
    unsure_share : float
        Points whose deviation is that many times the wanted one are taken again, if the line was noisier than planned.
    response_rung, most_noise : float, float
        Ratio of the responses, and of the noise, that are planned for: then only few forms of windows occur. At most
        so many times the noise of the calibration is planned for.

    Raises
    ------
    BadInput
        When a value makes no sense, or a step is too coarse for the edges.
    """

    wanted_sd_mm: float = 0.2
    nearest_mm: float = MIN_DISTANCE.value
    farthest_mm: float = 1200.0
    settle_shots: int = 16
    steps_ps: tuple[float, ...] = (26.8, 20.1, 13.4, 10.0, 6.7, 5.0)
    sweeps: tuple[int, ...] = (1, 2, 3, 4, 6, 8)
    shared_reference: bool = True
    first_response_mv: float = 30.0
    free_shots: int = 0
    foot_ps: float = 180.0
    top_ps: float = 240.0
    coarsest_ps: float = 40.0
    margins_ps: tuple[float, ...] = (30.0, 60.0, 120.0, 240.0)
    reference_margin_ps: float = 20.0
    min_response_mv: float = 3.0
    monitor_sd_share: float = 0.6
    mark_sd_mm: float = 0.15
    neighbours: int = 4
    dropped_share: float = 0.75
    response_rung: float = 1.1
    unsure_share: float = 1.3
    most_noise: float = 3.0

    def __post_init__(self) -> None:
        if not (self.wanted_sd_mm > 0 and 0 < self.nearest_mm < self.farthest_mm and self.first_response_mv > 0):
            raise BadInput(
                f"windows cannot be planned for {self.wanted_sd_mm:g} mm from {self.nearest_mm:g} to "
                f"{self.farthest_mm:g} mm at {self.first_response_mv:g} mV; all must be positive, and the range rise"
            )
        if not (self.steps_ps and self.sweeps and min(self.steps_ps) > 0 and min(self.sweeps) >= 1):
            raise BadInput("the planner needs at least one step above 0 ps and one number of sweeps of 1 or more")
        if (coarsest := max(self.steps_ps)) > self.coarsest_ps:
            raise BadInput(
                f"a step of {coarsest:g} ps is too coarse for edges of 210 ps; at most {self.coarsest_ps:g} ps"
            )


def cheapest_windows(
    settings: PlanSettings,
    calibration: Calibration,
    *,
    reference_margin_ps: float,
    margin_ps: float,
    response_mv: float,
    sharing: int,
) -> tuple[Window, Window]:
    """Return the windows over reference and echo, their starts counted from the 50 % points of the pulses.

    Those that take the shortest time of all that promise what is wanted, the best ones of equal time; if none does,
    the best there are.

    Parameters
    ----------
    settings : PlanSettings
    calibration : Calibration
        With templates and noise.
    reference_margin_ps, margin_ps : float
        By how much each pulse may be off from where it is expected.
    response_mv : float
        Amplitude of the echo.
    sharing : int
        Records that share one reference.
    """
    s = settings
    references, echoes = _windows(s, reference_margin_ps), _windows(s, margin_ps)
    promised = promised_sd_mm(
        calibration,
        references,
        echoes,
        response_mv=response_mv,
        room_ps=(reference_margin_ps + s.foot_ps, margin_ps + s.foot_ps),
        sharing=sharing if s.shared_reference else 1,
    )
    first = np.maximum([w.shots(s.settle_shots) for w in references], s.free_shots)
    shots = np.add.outer(first, [w.shots(s.settle_shots) for w in echoes])
    enough = promised <= s.wanted_sd_mm
    cost = np.where(enough, shots, np.inf) if enough.any() else promised
    r, e = np.unravel_index(np.lexsort((promised.ravel(), cost.ravel()))[0], promised.shape)
    return references[r], echoes[e]


def _windows(settings: PlanSettings, margin_ps: float) -> list[Window]:
    """Return the windows that cover a pulse to a margin, from few shots to many."""
    span = settings.foot_ps + settings.top_ps + 2 * margin_ps
    return [
        Window(-margin_ps - settings.foot_ps, step, int(np.ceil(span / step)) + 1, sweeps)
        for sweeps in settings.sweeps
        for step in settings.steps_ps
    ]
