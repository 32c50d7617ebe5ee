"""The simulated radar without firmware, calibrated as on the bench, and the Cramer-Rao bound of its traces."""

from __future__ import annotations

import datetime
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from picoradar.instrument.calibration import METHODS, Calibration
from picoradar.instrument.ranging import Pulse, Ranges, estimate, fit_walk, learn, range_bound_mm2
from picoradar.sim.physics import OPERATING_DEGC, OPERATING_V, TABLE_PS, Receiver, Transmitter
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.validation import SWEEPS, TIMES_PS, Bench, painted

FloatArray = NDArray[np.float64]

DISTANCE_MM = 1000.0
CARDS_MM = 900.0  # where gray cards stand: at 1 m speckle keeps some white ones below 68 mV
CALIBRATED_MV = np.geomspace(10.0, 68.0, 12)


def readings(bench: Bench, count: int, sweeps: int, *, after: int = 0) -> tuple[FloatArray, FloatArray]:
    """Return traces (R, S) mV and true ranges (R,) mm, of records that come after so many others."""
    bench.skip(after)
    taken = [bench.take(sweeps=sweeps) for _ in range(count)]
    return np.stack([trace for trace, _ in taken]), np.array([truth.range_mm for _, truth in taken])


@lru_cache(maxsize=1)
def training(seed: int, count: int, world: str = "dissertation") -> list[tuple[FloatArray, FloatArray]]:
    """Take readings of 12 gray levels before one radar, 8 sweeps each: traces and true ranges of each level.

    One seed, for what is the radar's own, as the phase of its pick-up, goes with the seed.
    """
    changes = {"target": "plate", "distance_mm": CARDS_MM, "world": world}
    levels = [painted(seed, mv, **changes) for mv in CALIBRATED_MV]
    return [readings(bench, count, SWEEPS, after=k * count) for k, bench in enumerate(levels)]


@lru_cache(maxsize=1)
def calibrate(seed: int, count: int = 200, world: str = "dissertation") -> Calibration:
    """Do the bench procedure on 12 gray levels."""
    series = training(seed, count, world)
    templates, noise = learn([traces for traces, _ in series], TIMES_PS, sweeps=SWEEPS)
    bare = Calibration(
        date=datetime.datetime.now(datetime.UTC),
        provenance="benchmarks/ranging.py",
        mirror_separation_mm=SimulationSettings().mirror_separation_mm,
        templates=templates,
        noise=noise,
    )
    found = {
        method: [estimate(x, TIMES_PS, method=method, calibration=bare, sweeps=SWEEPS) for x, _ in series]
        for method in METHODS
    }
    brightest = found["template"][-1]
    zero = float(np.mean(series[-1][1] - brightest.range_mm))
    walk = {
        method: fit_walk(
            [(r.response_mv, r.range_mm + zero - true) for r, (_, true) in zip(found[method], series, strict=True)]
        )
        for method in METHODS
    }
    place = float(np.median(brightest.reference_ps))
    return bare.model_copy(update={"range_zero_mm": zero, "walk": walk, "reference_ps": (place - 60.0, place + 60.0)})


class Bound:
    """The Cramer-Rao bound of the simulated radar."""

    def __init__(self) -> None:
        self.settings = SimulationSettings()
        self.receiver = Receiver(self.settings)
        self.laser = Transmitter(self.settings).pulse(OPERATING_V, OPERATING_DEGC)
        self._shape = lru_cache(maxsize=64)(self._make_shape)

    def _make_shape(self, response_mv: float) -> tuple[CubicSpline, float, float, float]:
        """The pulse at a response, where it crosses half of its peak, and its extent."""
        charge = self.receiver.reference_charge_fc(response_mv / self.settings.reference_response_mv)
        for _ in range(40):
            (pulse,) = self.receiver.pulses(np.zeros(1), np.array([charge]), self.laser.fwhm_ps)
            charge *= response_mv / pulse.response_mv
        place = pulse.begin_ps + TABLE_PS * np.arange(len(pulse.shape))
        spline = CubicSpline(place[::16], pulse.shape[::16].astype(np.float64))
        before = int(np.argmax(pulse.shape >= pulse.response_mv / 2))
        half = float(
            np.interp(pulse.response_mv / 2, pulse.shape[before - 1 : before + 1], place[before - 1 : before + 1])
        )
        return spline, half, float(place[0]), float(place[-17])

    def pulse(self, time_ps: float, response_mv: float) -> Pulse:
        def signal(after_ps: FloatArray, amplitude_mv: float) -> FloatArray:
            spline, own_half_ps, first, last = self._shape(amplitude_mv)
            at = after_ps + own_half_ps
            return np.where((at > first) & (at < last), spline(np.clip(at, first, last)), 0.0)

        return Pulse(signal, time_ps, response_mv)

    def variance(self, signal_mv: FloatArray, slope: FloatArray) -> FloatArray:
        signal = np.maximum(signal_mv, 0.0)
        quantised = self.settings.mv_per_code**2 / 12
        laser = self.receiver.shot_noise_mv * signal + (self.laser.energy_noise * signal) ** 2
        return self.receiver.dark_noise_mv**2 + quantised + laser + (self.settings.trigger_jitter_ps * slope) ** 2

    def sd_mm(self, ranges: Ranges, response_mv: float, sweeps: int) -> float:
        start, stop = float(np.nanmedian(ranges.reference_ps)), float(np.nanmedian(ranges.echo_ps))
        reference = self.pulse(start, self.settings.reference_response_mv)
        return float(
            np.sqrt(range_bound_mm2(reference, self.pulse(stop, response_mv), TIMES_PS, self.variance, sweeps))
        )
