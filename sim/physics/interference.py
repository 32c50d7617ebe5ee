"""`Interference`: what is added to the signal behind the photodiode: mains hum, 1/f noise and pick-up."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.flicker import Flicker
from picoradar.sim.physics.noise import Noise
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.wires import Acquisition

ORDERS = np.array([1.0, 3.0, 5.0])  # harmonics of the mains; chosen: rectifiers give the odd ones
SHARES = np.array([1.0, 0.3, 0.15])  # of the fundamental


class Interference:
    """Hum and 1/f noise are functions of the time of each shot, pick-up is one of the time after the trigger.

    Parameters
    ----------
    settings : SimulationSettings
    noise : Noise
    """

    def __init__(self, settings: SimulationSettings, noise: Noise) -> None:
        self._s = settings
        self._noise = noise
        self._start_rad = lru_cache(maxsize=64)(self._draw_phase)
        self._within = lru_cache(maxsize=64)(_within_sweep)
        self._flicker = Flicker(noise, settings.flicker_mv)
        self._pickup_rad = noise.stream("sampler.pickup").uniform(0.0, 2 * math.pi)

    def add(self, signal_mv: NDArray[np.float32], wanted: Acquisition, first_shot: int) -> None:
        """Add all of it to ``signal_mv`` (sweeps, samples) in place; ``first_shot`` counts from the run's first."""
        s = self._s
        per_sweep = wanted.samples + wanted.settle_shots
        if s.hum_mv > 0:
            signal_mv += self._hum(wanted, first_shot, per_sweep)
        if s.flicker_mv > 0:
            shots = self._flicker.of_run(wanted.key[:2], first_shot, wanted.sweeps * per_sweep, wanted.prf_hz)
            signal_mv += shots.reshape(wanted.sweeps, per_sweep)[:, wanted.settle_shots :]
        if s.pickup_mv > 0 and wanted.gate_open:
            times_ps = wanted.delay_ps + wanted.step_ps * np.arange(wanted.samples)
            phase = 2e-3 * math.pi * s.pickup_ghz * times_ps + self._pickup_rad
            signal_mv += (s.pickup_mv * np.sin(phase)).astype(np.float32)

    def _hum(self, wanted: Acquisition, first_shot: int, per_sweep: int) -> NDArray[np.float32]:
        """Hum (sweeps, samples): sin(a + b) of sweep and sample is a product of two narrow matrices."""
        start_rad = self._start_rad(*wanted.key[:2])
        per_shot = 2 * math.pi * self._s.mains_hz / wanted.prf_hz
        sweeps = start_rad + per_shot * (first_shot + wanted.settle_shots + per_sweep * np.arange(wanted.sweeps))
        before = np.outer(sweeps, ORDERS)
        left = np.hstack([np.sin(before) * SHARES, np.cos(before) * SHARES]).astype(np.float32)
        left *= np.float32(self._s.hum_mv)
        return np.asarray(left @ self._within(wanted.samples, per_shot))

    def _draw_phase(self, run: int, repeat: int) -> float:
        return float(self._noise.stream("bridge.hum", run, repeat).uniform(0.0, 2 * math.pi))


def _within_sweep(samples: int, per_shot: float) -> NDArray[np.float32]:
    """Cosines and sines (6, samples) of the harmonics along a sweep."""
    phases = np.outer(ORDERS, per_shot * np.arange(samples))
    return np.vstack([np.cos(phases), np.sin(phases)]).astype(np.float32)
