"""`Pointing`: what moves the beam besides the command: dither of the mirrors' servos and slow drift."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.device_time import DeviceTime
from picoradar.sim.physics.drift import SlowDrift
from picoradar.sim.physics.noise import Noise
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.wires import Acquisition

TONES_HZ = np.geomspace(200.0, 20e3, 12)  # Scanlab's glossary states 200 Hz to 20 kHz for dither


class Pointing:
    """Deviation of both optical angles.

    Dither is a sum of tones of equal strength and random phase. A window sees its mean over its own duration, which
    takes the fast tones out.

    Parameters
    ----------
    settings : SimulationSettings
    noise : Noise
    """

    def __init__(self, settings: SimulationSettings, noise: Noise) -> None:
        self._noise = noise
        self._starts_rad = lru_cache(maxsize=64)(self._draw_phases)
        self._strengths_rad = lru_cache(maxsize=64)(self._make_strengths)
        self._dither_rad = settings.dither_urad * 1e-6
        self._drifts = [
            SlowDrift(noise, name, settings.pointing_drift_urad * 1e-6, settings.pointing_drift_time_s)
            for name in ("scanner.pointing_x", "scanner.pointing_y")
        ]
        self._drifting = settings.pointing_drift_urad > 0

    def deviation_rad(self, wanted: Acquisition, time: DeviceTime) -> NDArray[np.float64]:
        """Get the mean deviation (2,) of the angles over a window."""
        off = np.zeros(2)
        if self._drifting:
            slow_s = time.slow_s(wanted)
            off[0], off[1] = (drift.at(slow_s) for drift in self._drifts)
        if self._dither_rad > 0:
            length_s = wanted.sweeps * (wanted.samples + wanted.settle_shots) / wanted.prf_hz
            middle_s = time.shots_of_run(wanted) / wanted.prf_hz + length_s / 2
            tones = np.sin((2 * math.pi * middle_s) * TONES_HZ + self._starts_rad(*wanted.key[:2]))
            off += tones @ self._strengths_rad(length_s)
        return off

    def _make_strengths(self, length_s: float) -> NDArray[np.float64]:
        """What a window of some length sees of each tone (rad)."""
        return self._dither_rad * math.sqrt(2 / len(TONES_HZ)) * np.sinc(TONES_HZ * length_s)

    def _draw_phases(self, run: int, repeat: int) -> NDArray[np.float64]:
        return self._noise.stream("scanner.dither", run, repeat).uniform(0.0, 2 * math.pi, (2, len(TONES_HZ)))
