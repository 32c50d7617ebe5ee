"""`Interference`: what is added to the signal behind the photodiode: mains hum, 1/f noise and pick-up."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.flicker import LOOP_S, flicker
from picoradar.sim.physics.noise import Noise
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.wires import Acquisition

HARMONICS = {1: 1.0, 3: 0.3, 5: 0.15}  # order: share of the fundamental; chosen: rectifiers give the odd ones


class Interference:
    """Hum and 1/f noise are functions of the time of each shot, pick-up is one of the time after the trigger.

    Hum and 1/f noise of the bench are one closed loop of 12.8 s, longer than a run of a scan. Each run begins to read
    it at a place of its own, which is drawn by seed and run.

    Parameters
    ----------
    settings : SimulationSettings
    noise : Noise
    """

    def __init__(self, settings: SimulationSettings, noise: Noise) -> None:
        self._s = settings
        self._noise = noise
        self._loop = lru_cache(maxsize=4)(self._make_loop)
        self._begin = lru_cache(maxsize=64)(self._draw_begin)
        self._pickup = lru_cache(maxsize=64)(self._make_pickup)
        self._pickup_rad = noise.stream("sampler.pickup").uniform(0.0, 2 * math.pi)

    def add(self, signal_mv: NDArray[np.float32], wanted: Acquisition, first_shot: int) -> None:
        """Add all of it to ``signal_mv`` (sweeps, samples) in place; ``first_shot`` counts from the run's first."""
        s = self._s
        if s.hum_mv > 0 or s.flicker_mv > 0:
            per_sweep = wanted.samples + wanted.settle_shots
            shots = self._of_shots(wanted, first_shot, wanted.sweeps * per_sweep)
            signal_mv += shots.reshape(wanted.sweeps, per_sweep)[:, wanted.settle_shots :]
        if s.pickup_mv > 0 and wanted.gate_open:
            signal_mv += self._pickup(wanted.delay_ps, wanted.step_ps, wanted.samples)

    def _of_shots(self, wanted: Acquisition, first_shot: int, shots: int) -> NDArray[np.float32]:
        """Hum and 1/f noise (shots,), settling shots included."""
        loop = self._loop(wanted.prf_hz)
        begin = (int(self._begin(*wanted.key[:2]) * len(loop)) + first_shot) % len(loop)
        part = loop[begin : begin + shots]
        while len(part) < shots:
            part = np.concatenate([part, loop[: shots - len(part)]])
        return part

    def _make_loop(self, prf_hz: float) -> NDArray[np.float32]:
        """Sum of hum and 1/f noise at each shot of the loop, in which the mains has whole periods (to 0.04 Hz)."""
        shots = round(LOOP_S * prf_hz)
        loop = flicker(self._noise.stream("bridge.flicker"), self._s.flicker_mv, shots)
        if self._s.hum_mv > 0:
            periods = round(self._s.mains_hz * LOOP_S)
            alike = math.gcd(periods, shots)  # the loop is as many equal parts
            turns_rad = np.arange(shots // alike) * (2 * math.pi * periods / shots)
            wave = sum(share * np.sin(order * turns_rad) for order, share in HARMONICS.items())
            loop += np.tile(np.asarray(self._s.hum_mv * wave, dtype=np.float32), alike)
        return loop

    def _draw_begin(self, run: int, repeat: int) -> float:
        """Where in the loop a run begins, 0 to 1."""
        return float(self._noise.stream("bridge.interference", run, repeat).uniform())

    def _make_pickup(self, delay_ps: float, step_ps: float, samples: int) -> NDArray[np.float32]:
        """Pick-up along a sweep (samples,)."""
        phase = 2e-3 * math.pi * self._s.pickup_ghz * (delay_ps + step_ps * np.arange(samples)) + self._pickup_rad
        return np.asarray(self._s.pickup_mv * np.sin(phase), dtype=np.float32)
