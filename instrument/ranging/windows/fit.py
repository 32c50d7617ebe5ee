"""`PointWindows`: the two windows of a point of the raster; and the range uncertainty that windows promise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.traces import Window
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.ranging.combining import combine
from picoradar.instrument.ranging.pair import to_ranges
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import ShapeTable
from picoradar.instrument.ranging.template import shapes_of, tables
from picoradar.instrument.ranging.template_fit import PulseFit

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class PointWindows:
    """The two windows of one point of the raster; ``wide`` when the echo is searched in the whole working range."""

    reference: Window
    echo: Window
    wide: bool

    def shots(self, settle_shots: int) -> int:
        """Get the laser shots that both windows take."""
        return self.reference.shots(settle_shots) + self.echo.shots(settle_shots)


def promised_sd_mm(
    calibration: Calibration,
    references: Sequence[Window],
    echoes: Sequence[Window],
    *,
    response_mv: float,
    room_ps: tuple[float, float],
    sharing: int = 1,
) -> FloatArray:
    """Return the standard deviation (R, E) (mm) that ranges from each pair of windows will have.

    It is the estimator's own covariance, which is the Cramer-Rao bound of the samples taken.

    Parameters
    ----------
    calibration : Calibration
        With templates and noise.
    references, echoes : sequences of R and E Window
    response_mv : float
        Amplitude of the echo.
    room_ps : (float, float)
        How far behind the start of its window the 50 % point of reference and echo lies.
    sharing : int
        Records that share one reference.

    Raises
    ------
    BadInput
        When the calibration has no templates.
    """
    shapes, limits = shapes_of(calibration), RangingSettings()
    of_references = [tables(shapes, w.step_ps, limits)[0] for w in references]
    of_echoes = [tables(shapes, w.step_ps, limits)[1] for w in echoes]
    first = _promise(of_references, references, None, room_ps[0], limits)
    second = _promise(of_echoes, echoes, response_mv, room_ps[1], limits)
    index = np.indices((len(references), len(echoes))).reshape(2, -1)
    blank = np.zeros(index.shape[1])
    fits = [
        PulseFit(blank, amplitudes[i], blank, covariances[i], blank, blank)
        for (amplitudes, covariances), i in zip((first, second), index, strict=True)
    ]
    pair = combine(fits[0], fits[1], blank, blank)
    if sharing > 1:
        shared = pair.echo_variance_ps2 + pair.reference_variance_ps2 / sharing
        pair = replace(pair, interval_variance_ps2=shared)
    anywhere = calibration.model_copy(update={"reference_ps": None})
    ranges = to_ranges(pair, np.zeros(len(blank), dtype=np.uint16), "template", anywhere, limits)
    return np.sqrt(ranges.variance_mm2).reshape(len(references), len(echoes))


def _promise(
    shapes: Sequence[ShapeTable],
    windows: Sequence[Window],
    amplitude_mv: float | None,
    room_ps: float,
    limits: RangingSettings,
) -> tuple[FloatArray, FloatArray]:
    """Return the amplitude (W,) and the covariance (W, 3, 3) of a fit in each window."""
    amplitudes, covariances = np.empty(len(windows)), np.empty((len(windows), 3, 3))
    for k, (table, window) in enumerate(zip(shapes, windows, strict=True)):
        samples = min(window.samples, round((limits.piece_lead_ps + limits.piece_trail_ps) / window.step_ps))
        amplitudes[k] = table.usual_mv if amplitude_mv is None else amplitude_mv
        delay = np.array([min(room_ps, limits.piece_lead_ps)])
        information = table.information(delay, amplitudes[k : k + 1], samples)[0]
        covariances[k] = np.linalg.inv(information) / window.sweeps
    return amplitudes, covariances
