"""How the bare half of a piece stretches echoes, more than the painted one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration, Stretch
from picoradar.instrument.procedures.penetration.step import FloatArray, block_means
from picoradar.instrument.procedures.station.measured import Measured
from picoradar.instrument.ranging import Leftover, learn_stretch, left_of_echoes


class PoseEchoes(NamedTuple):
    """What fits leave of the echoes of both halves in one pose, and where those of the bare one are (N, 2), mm."""

    painted: Leftover
    bare: Leftover
    places_mm: FloatArray


def echoes_of(sweep: Measured, sides: Sequence[NDArray[np.bool_]], calibration: Calibration) -> PoseEchoes:
    """Fit the echoes of both halves of a pose.

    Parameters
    ----------
    sweep : Measured
        Whole traces of N points.
    sides : two (N,) bool arrays
        Points of the painted and of the bare half.
    calibration : Calibration
    """
    trace, ranges = sweep.trace, sweep.ranges("template", calibration)
    chosen = [np.flatnonzero(side & np.isfinite(ranges.range_mm)) for side in sides]
    painted, bare = (
        left_of_echoes(trace.mv[these], trace.times_ps, ranges.taken(these), calibration, trace.sweeps)
        for these in chosen
    )
    return PoseEchoes(painted, bare, sweep.cloud.points_mm[chosen[1], :2])


def stretch_of_piece(poses: Sequence[PoseEchoes]) -> Stretch | None:
    """Return how the piece stretches echoes; None where that does not stand out of the noise."""
    learnt = learn_stretch([(pose.painted, pose.bare) for pose in poses])
    if learnt is None:
        return None
    pattern, shares = learnt
    means = [block_means(pose.places_mm, share) for pose, share in zip(poses, shares, strict=True)]
    errors = [float(np.std(of_blocks) / np.sqrt(max(len(of_blocks) - 1, 1))) for of_blocks in means]
    return pattern.model_copy(update={"sd": min(float(np.mean(errors)), 1.0)})  # one piece: no better by poses
