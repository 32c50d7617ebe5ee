"""What reference and echo do to each other where they overlap.

`without_other` takes one of them away; `moved_by_tail` tells where a crossing is moved.

The tail of the reference lasts 1.5 ns, 22 cm of range: an echo in it is moved by millimetres where it is weak. The
pulses are learnt with their tails, so what one adds to the other's piece of the trace is known once both are fitted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Templates
from picoradar.instrument.ranging.half_maximum import Edges
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.shape_table import ShapeTable
from picoradar.instrument.ranging.template_fit import PulseFit

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

ROUNDS = 2  # of taking each pulse away from the other: a third one moves neither by a thousandth of a millimetre


def overlapping(start_ps: FloatArray, stop_ps: FloatArray, settings: RangingSettings) -> BoolArray:
    """Return in which records (R,) the piece of the echo begins before the reference has died away."""
    with np.errstate(invalid="ignore"):
        return np.asarray(stop_ps - start_ps < settings.table_reach_ps + settings.piece_lead_ps, dtype=np.bool_)


def without_other(
    traces_mv: FloatArray, after_ps: FloatArray, other: PulseFit, table: ShapeTable, where: BoolArray
) -> FloatArray:
    """Return traces without the other pulse.

    Parameters
    ----------
    traces_mv : (R, M) float array
        Pieces of traces, or whole ones.
    after_ps : (R,) float array
        By how much each begins after the instant that the other pulse's delay counts from.
    other : PulseFit
        The other pulse of each record.
    table : ShapeTable
        Of the other pulse.
    where : (R,) bool array
        Records in which it reaches into the piece; the rest are returned as they are.
    """
    if not where.any():
        return traces_mv
    apart = traces_mv.copy()
    delay, amplitude = other.delay_ps[where] - after_ps[where], other.amplitude_mv[where]
    apart[where] -= table.pulse(delay, amplitude, traces_mv.shape[1])[0]
    return apart


def moved_by_tail(start: Edges, stop: Edges, templates: Templates) -> BoolArray:
    """Return in which records (R,) the tail of the reference moves the half maximum of the echo by more than its
    standard deviation.

    The tail lifts (or, where it undershoots, lowers) the edge by its value there, and the level of the crossing by half
    of its value under the peak.
    """
    time = templates.start_ps + templates.step_ps * np.arange(len(templates.reference))
    interval = stop.time_ps - start.time_ps
    to_peak_ps = float(time[np.argmax(templates.echoes[-1])])
    tail, under_peak = (
        np.interp(at, time, templates.reference, left=0.0, right=0.0) for at in (interval, interval + to_peak_ps)
    )
    with np.errstate(invalid="ignore"):
        moved_ps = start.height_mv * (tail - under_peak / 2) * 2.0 * stop.baseline_ps_per_mv
        return np.asarray(np.abs(moved_ps) > np.sqrt(stop.time_variance_ps2), dtype=np.bool_)
