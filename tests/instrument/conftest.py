"""A synthetic receiver for the tests of ranging: its own pulse shape, walk and noise, nothing of the simulator's."""

from __future__ import annotations

import datetime

import numpy as np
import pytest
from scipy.special import erf

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.ranging import SPEED_OF_LIGHT_MM_PER_PS, Pulse, estimate, fit_walk, learn, range_bound_mm2

HALF_LIGHT = SPEED_OF_LIGHT_MM_PER_PS / 2


class SyntheticReceiver:
    """Pulses of rise 210 ps and width 600 ps whose edge slows down below 25 mV, sampled with white and jitter noise."""

    times_ps = 6500.0 + 6.7 * np.arange(1430)
    reference_ps = 7100.0
    reference_mv = 45.0
    floor_mv = 0.57
    jitter_ps = 2.5
    share = 0.015

    def pulse(self, t_ps: np.ndarray, response_mv: float) -> np.ndarray:
        """The pulse (mV) at times after the light: the foot stays, so a slower edge comes later."""
        width = 116.0 * (1 + 0.6 / (1 + np.exp((response_mv - 14.0) / 4.0)))

        def shape(t: np.ndarray) -> np.ndarray:
            return 0.25 * (1 + erf((t - 1.3 * width) / width)) * (1 - erf((t - 750.0) / 220.0))

        return response_mv * shape(t_ps) / shape(np.linspace(0.0, 900.0, 3001)).max()

    def half_ps(self, response_mv: float) -> float:
        """When the pulse crosses half of its peak."""
        t = np.linspace(-200.0, 450.0, 130_001)
        return float(np.interp(response_mv / 2, self.pulse(t, response_mv), t))

    def signal(self, times_ps: np.ndarray, interval_ps: float, response_mv: float) -> np.ndarray:
        light = self.pulse(times_ps - self.reference_ps, self.reference_mv)
        return light + self.pulse(times_ps - self.reference_ps - interval_ps, response_mv)

    def variance(self, signal_mv: np.ndarray, slope: np.ndarray) -> np.ndarray:
        return self.floor_mv**2 + (self.share * signal_mv) ** 2 + (self.jitter_ps * slope) ** 2

    def traces(
        self,
        times_ps: np.ndarray,
        interval_ps: float,
        response_mv: float,
        *,
        records: int,
        seed: int,
        sweeps: int = 1,
    ) -> np.ndarray:
        clean = self.signal(times_ps, interval_ps, response_mv)
        slope = self.signal(times_ps + 0.5, interval_ps, response_mv) - self.signal(
            times_ps - 0.5, interval_ps, response_mv
        )
        sd = np.sqrt(self.variance(clean, slope) / sweeps)
        return clean + sd * np.random.default_rng(seed).standard_normal((records, times_ps.size))

    def range_mm(self, interval_ps: float, response_mv: float = 0.0) -> float:
        """Range without range zero; with a response, where its own 50 % point has it (walk included)."""
        late = self.half_ps(response_mv) - self.half_ps(self.reference_mv) if response_mv else 0.0
        return HALF_LIGHT * (interval_ps + late)

    def bound_mm2(self, times_ps: np.ndarray, interval_ps: float, response_mv: float, sweeps: int = 1) -> float:
        """The Cramer-Rao bound of a range from samples at these times."""

        def seen(own_mv: float, light_ps: float) -> Pulse:
            late = self.half_ps(own_mv)
            return Pulse(lambda t, amplitude: self.pulse(t + late, amplitude), light_ps + late, own_mv)

        reference = seen(self.reference_mv, self.reference_ps)
        echo = seen(response_mv, self.reference_ps + interval_ps)
        return range_bound_mm2(reference, echo, times_ps, self.variance, sweeps)

    def calibrate(self, levels_mv: np.ndarray, records: int, sweeps: int) -> Calibration:
        """The bench procedure: learn shapes and noise, then the walk of both estimators."""
        interval = 4003.1
        series = [
            self.traces(self.times_ps, interval, level, records=records, sweeps=sweeps, seed=900 + k)
            for k, level in enumerate(levels_mv)
        ]
        templates, noise = learn(series, self.times_ps, sweeps=sweeps)
        bare = Calibration(
            date=datetime.datetime(2026, 1, 31, tzinfo=datetime.UTC),
            provenance="synthetic gray-target series",
            mirror_separation_mm=30.0,
            templates=templates,
            noise=noise,
        )
        walk = {}
        for method in ("half-maximum", "template"):
            found = [estimate(s, self.times_ps, method=method, calibration=bare, sweeps=sweeps) for s in series]
            walk[method] = fit_walk([(r.response_mv, r.range_mm - HALF_LIGHT * interval) for r in found])
        lag = self.reference_ps + self.half_ps(self.reference_mv)
        return bare.model_copy(update={"walk": walk, "reference_ps": (lag - 50.0, lag + 50.0)})


@pytest.fixture(scope="session")
def receiver() -> SyntheticReceiver:
    return SyntheticReceiver()


@pytest.fixture(scope="session")
def calibrated(receiver: SyntheticReceiver) -> Calibration:
    """12 gray levels x 200 readings of 8 sweeps."""
    return receiver.calibrate(np.geomspace(10.0, 68.0, 12), records=200, sweeps=8)
