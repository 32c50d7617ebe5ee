"""A bench of physics alone, and an estimator of its own for the traces that come out of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from picoradar.drivers.clock import VirtualClock
from picoradar.sim.physics import DiodeBlock, MirrorPair, Noise, Optics, Scene, build_scene
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.wires import Acquisition, TriggerLine

C_MM_PER_PS = 0.299792458
START_PS, STEP_PS, SAMPLES, SWEEPS = 6500.0, 6.7, 1430, 8


@dataclass
class FixedSupply:
    volts: float = 290.0

    def output_v(self) -> float:
        return self.volts


@dataclass
class Bench:
    """The radar without firmware: knobs in, codes out."""

    clock: VirtualClock
    settings: SimulationSettings
    trigger: TriggerLine
    supply: FixedSupply
    block: DiodeBlock
    mirrors: MirrorPair
    scene: Scene
    optics: Optics

    def record(self, number: int, *, sweeps: int = SWEEPS, start_ps: float = START_PS, gate: bool = True):
        wanted = Acquisition((number, 0, 0, 0), self.clock.now(), 80e3, start_ps, STEP_PS, SAMPLES, sweeps, 16, gate)
        return self.optics.acquire(wanted)

    def trace_mv(self, number: int, *, sweeps: int = SWEEPS) -> NDArray[np.float64]:
        sums = self.record(number, sweeps=sweeps)
        return (sums / sweeps - self.settings.code_of_zero) * self.settings.mv_per_code

    def interval_mm(self, number: int, *, sweeps: int = SWEEPS) -> float:
        """Half the light path between the two 50 % points of one record."""
        trace = self.trace_mv(number, sweeps=sweeps)
        truth = self.optics.truth[(number, 0, 0)]
        reference_ps = half_maximum_ps(trace, 6700.0, 8300.0)
        expected_ps = reference_ps + 2 * truth.range_mm / C_MM_PER_PS - 2840.0
        return (half_maximum_ps(trace, expected_ps - 300.0, expected_ps + 700.0) - reference_ps) * C_MM_PER_PS / 2


def half_maximum_ps(trace_mv: NDArray[np.float64], first_ps: float, last_ps: float) -> float:
    """Instant of the 50 % level before the highest sample between two times."""
    first, last = (int((t - START_PS) / STEP_PS) for t in (first_ps, last_ps))
    peak = first + int(np.argmax(trace_mv[first:last]))
    level = trace_mv[peak] / 2
    below = peak - int(np.argmax(trace_mv[peak::-1] < level))
    share = (level - trace_mv[below]) / (trace_mv[below + 1] - trace_mv[below])
    return START_PS + STEP_PS * (below + share)


@pytest.fixture
def make_bench() -> Callable[..., Bench]:
    """Make a bench with a warm diode; keywords are settings."""

    def make(seed: int = 1, **changes: object) -> Bench:
        settings = SimulationSettings.model_validate({"ambient_degc": 23.0, "target": "plate", **changes})
        clock, noise = VirtualClock(), Noise(seed)
        trigger, supply = TriggerLine(80e3), FixedSupply()
        block, mirrors = DiodeBlock(clock, settings), MirrorPair(clock, settings, noise)
        scene = build_scene(settings, noise)
        optics = Optics(settings, noise, trigger, supply, block, mirrors, scene)
        return Bench(clock, settings, trigger, supply, block, mirrors, scene, optics)

    return make
