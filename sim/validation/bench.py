"""A radar of physics alone, without firmware, and a 50 % estimator of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.clock import VirtualClock
from picoradar.sim.physics import (
    LIGHT_MM_PER_PS,
    OPERATING_DEGC,
    OPERATING_V,
    Beam,
    DiodeBlock,
    MirrorPair,
    Noise,
    Optics,
    Truth,
    build_scene,
    trace,
)
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.wires import Acquisition, TriggerLine

FloatArray = NDArray[np.float64]

PRF_HZ = 80e3
START_PS, STEP_PS, SAMPLES, SWEEPS = 6500.0, 6.7, 1430, 8
TIMES_PS = START_PS + STEP_PS * np.arange(SAMPLES)
REFERENCE_WINDOW_PS = (6700.0, 8300.0)
ECHO_LAG_PS = 2840.0  # the interval between the pulses is the light's path to the target and back, less this
SETTLE_S = 0.1


@dataclass
class FixedSupply:
    """A supply that holds its voltage."""

    volts: float = OPERATING_V

    def output_v(self) -> float:
        """Get the voltage."""
        return self.volts


class Bench:
    """Laser, mirrors, target and sampler at their operating point.

    Parameters
    ----------
    seed : int
        Root seed.
    **changes : object
        Settings that differ from the defaults.
    """

    def __init__(self, seed: int, **changes: object) -> None:
        self.settings = SimulationSettings.model_validate({"ambient_degc": OPERATING_DEGC, **changes})
        self.settings = self.settings.model_copy(update={"pulser_heat_share": 0.0})  # nothing regulates here
        self.clock = VirtualClock()
        self.supply = FixedSupply()
        noise = Noise(seed)
        self.mirrors = MirrorPair(self.clock, self.settings, noise)
        self.scene = build_scene(self.settings, noise)
        block = DiodeBlock(self.clock, self.settings)
        trigger = TriggerLine(PRF_HZ)
        self.optics = Optics(self.settings, noise, trigger, self.supply, block, self.mirrors, self.scene)
        self._number = 0

    def aim(self, x_rad: float, y_rad: float) -> None:
        """Send the beam to two optical angles and let the mirrors settle."""
        half_field = np.radians(self.settings.field_deg / 2)
        self.mirrors.command(x_rad / half_field, y_rad / half_field)
        self.clock.sleep(SETTLE_S)

    def skip(self, records: int) -> None:
        """Let the time of some records pass."""
        self._number += records

    def take(self, sweeps: int = SWEEPS, samples: int = SAMPLES) -> tuple[FloatArray, Truth]:
        """Take one record: trace (S,) in mV, and the true result."""
        self._number += 1
        key = (self._number, 0, 0, 0)
        wanted = Acquisition(key, self.clock.now(), PRF_HZ, START_PS, STEP_PS, samples, sweeps, 16, gate_open=True)
        sums = self.optics.acquire(wanted)
        trace_mv = (sums / sweeps - self.settings.code_of_zero) * self.settings.mv_per_code
        return trace_mv, self.optics.truth[key[:3]]

    def interval_mm(self, sweeps: int = SWEEPS) -> tuple[float, Truth]:
        """Measure half the light path between the 50 % points of reference and echo; NaN without an echo."""
        trace_mv, truth = self.take(sweeps)
        reference_ps = half_maximum_ps(trace_mv, *REFERENCE_WINDOW_PS)
        if not np.isfinite(truth.range_mm):
            return float("nan"), truth
        expected_ps = reference_ps + 2 * truth.range_mm / LIGHT_MM_PER_PS - ECHO_LAG_PS
        echo_ps = half_maximum_ps(trace_mv, expected_ps - 300.0, expected_ps + 700.0)
        return (echo_ps - reference_ps) * LIGHT_MM_PER_PS / 2, truth

    def ideal_beam(self, x_rad: float, y_rad: float) -> Beam:
        """Get the ray of two optical angles without any error of the scanner."""
        return trace(x_rad / 2, y_rad / 2, self.settings.mirror_separation_mm)


def painted(seed: int, response_mv: float, **changes: object) -> Bench:
    """Make a bench whose target is painted in the gray that gives a response at rest."""
    level = 0.5
    for _ in range(4):
        bench = Bench(seed, **{**changes, "reflectance": level})
        level *= response_mv / bench.take(sweeps=1, samples=1)[1].response_mv
    return Bench(seed, **{**changes, "reflectance": level})


def half_maximum_ps(trace_mv: FloatArray, first_ps: float, last_ps: float) -> float:
    """Get the instant of the 50 % level on the leading edge of the highest sample between two times.

    NaN when the trace does not fall below half of its peak before it.
    """
    first, last = (int((t - START_PS) / STEP_PS) for t in (first_ps, last_ps))
    peak = first + int(np.argmax(trace_mv[first:last]))
    level = trace_mv[peak] / 2
    low = trace_mv[peak::-1] < level
    if not low.any():
        return float("nan")
    below = peak - int(np.argmax(low))
    share = (level - trace_mv[below]) / (trace_mv[below + 1] - trace_mv[below])
    return float(START_PS + STEP_PS * (below + share))
