"""The fit of one pulse against known values: where it converges, what it says of its errors, what it leaves out.

The pulse has one shape at all amplitudes, so that the table's model is exact and every figure has a right value.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from picoradar.instrument.calibration import ShotNoise
from picoradar.instrument.ranging import RangingSettings
from picoradar.instrument.ranging.shape_table import PulseFamily, ShapeTable
from picoradar.instrument.ranging.template_fit import PulseFit, fit_pulses

Receiver = Any  # SyntheticReceiver of conftest.py
STEP_PS, SAMPLES = 6.7, 160
DELAY_PS = 251.3  # of the 50 % point after the first sample
NOISE = ShotNoise(floor_mv=0.57, signal_mv=0.01, signal_share=0.015, jitter_ps=2.5)
SETTINGS = RangingSettings()


class OnePulse:
    """Pieces of trace with a pulse of known delay and amplitude, and the table that knows its shape."""

    def __init__(self, receiver: Receiver, noise: ShotNoise = NOISE) -> None:
        self.receiver, self.noise = receiver, noise
        spacing = 0.5
        time = np.arange(-600.0, 1500.0, spacing)
        levels = np.array([4.0, 20.0, 90.0])
        family = PulseFamily(float(time[0]), spacing, levels, np.tile(self.shape(time), (3, 1)))
        self.table = ShapeTable(family, noise, STEP_PS, SETTINGS)

    def shape(self, time_ps: np.ndarray) -> np.ndarray:
        return self.receiver.pulse(time_ps + self.receiver.half_ps(45.0), 45.0) / 45.0

    def signal(self, delay_ps: float, amplitude_mv: float) -> np.ndarray:
        return amplitude_mv * self.shape(STEP_PS * np.arange(SAMPLES) - delay_ps)

    def variance(self, amplitude_mv: float) -> np.ndarray:
        signal = np.maximum(self.signal(DELAY_PS, amplitude_mv), 0.0)
        slope = self.signal(DELAY_PS - 0.5, amplitude_mv) - self.signal(DELAY_PS + 0.5, amplitude_mv)
        own = self.noise.floor_mv**2 + self.noise.signal_mv * signal + (self.noise.signal_share * signal) ** 2
        return own + (self.noise.jitter_ps * slope) ** 2

    def noisy(self, amplitude_mv: float, records: int, seed: int, sweeps: int = 1) -> np.ndarray:
        scatter = np.sqrt(self.variance(amplitude_mv) / sweeps)
        noise = np.random.default_rng(seed).standard_normal((records, SAMPLES))
        return 1.5 + self.signal(DELAY_PS, amplitude_mv) + scatter * noise

    def covariance(self, amplitude_mv: float) -> np.ndarray:
        """The Cramer-Rao bound of delay, amplitude and baseline, from the definition of the Fisher information."""
        by_delay = self.signal(DELAY_PS + 0.5, amplitude_mv) - self.signal(DELAY_PS - 0.5, amplitude_mv)
        design = np.stack([by_delay, self.signal(DELAY_PS, 1.0), np.ones(SAMPLES)])
        return np.linalg.inv((design / self.variance(amplitude_mv)) @ design.T)

    def fit(self, pieces: np.ndarray, start_ps: float = DELAY_PS, start_mv: float = 45.0, sweeps: int = 1) -> PulseFit:
        every = np.ones(len(pieces))
        return fit_pulses(pieces, self.table, start_ps * every, start_mv * every, sweeps * every, SETTINGS)


@pytest.fixture(scope="module")
def pulse(receiver: Receiver) -> OnePulse:
    return OnePulse(receiver)


@pytest.mark.parametrize("off_ps", [-60.0, -25.0, -9.0, 9.0, 25.0, 60.0])
@pytest.mark.parametrize("start_mv", [20.0, 45.0, 90.0])
def test_it_converges_to_the_true_pulse_from_a_coarse_start(pulse: OnePulse, off_ps: float, start_mv: float) -> None:
    found = pulse.fit(3.0 + pulse.signal(DELAY_PS, 47.0)[None], DELAY_PS + off_ps, start_mv)
    assert found.delay_ps[0] == pytest.approx(DELAY_PS, abs=0.03)
    assert found.amplitude_mv[0] == pytest.approx(47.0, abs=0.01)
    assert found.baseline_mv[0] == pytest.approx(3.0, abs=0.003)


@pytest.mark.parametrize("amplitude_mv", np.geomspace(44.0, 51.0, 6))  # over a whole rung of the table
@pytest.mark.parametrize("off_ps", [-2.9, 2.9])
def test_nothing_of_a_near_start_is_left_wherever_the_amplitude_stands_in_the_table(
    pulse: OnePulse, amplitude_mv: float, off_ps: float
) -> None:
    """One step is all it takes from here; without the mixed term 7 % of the start's error would come through."""
    found = pulse.fit(pulse.signal(DELAY_PS, amplitude_mv)[None], DELAY_PS + off_ps, amplitude_mv)
    assert found.delay_ps[0] == pytest.approx(DELAY_PS, abs=0.05)


@pytest.mark.parametrize("amplitude_mv", np.geomspace(44.0, 51.0, 6))
def test_a_pulse_without_noise_leaves_no_residual(pulse: OnePulse, amplitude_mv: float) -> None:
    """Half way between two delays of the table, so that the step from the entry to the fit counts in full."""
    between_ps = STEP_PS * (38 + 0.5 / 7)
    found = pulse.fit(pulse.signal(between_ps, amplitude_mv)[None], between_ps, amplitude_mv)
    assert found.residual_mv[0] < 5e-4
    assert found.misfit_sigmas[0] == pytest.approx(-np.sqrt((SAMPLES - 3) / 2), abs=1e-3)


@pytest.mark.parametrize(("amplitude_mv", "sweeps"), [(45.0, 1), (12.0, 8), (45.0, 8)])
def test_the_misfit_of_pure_noise_is_a_standard_score(pulse: OnePulse, amplitude_mv: float, sweeps: int) -> None:
    records = 8000
    # at an amplitude of the table: its weights are those of the nearest one, up to 2 % off
    (amplitude_mv,) = pulse.table.locate(np.array([DELAY_PS]), np.array([amplitude_mv]), SAMPLES).amplitude_mv
    found = pulse.fit(pulse.noisy(amplitude_mv, records, seed=3, sweeps=sweeps), DELAY_PS, amplitude_mv, sweeps)
    assert found.misfit_sigmas.mean() == pytest.approx(0.0, abs=4 / np.sqrt(records))
    assert found.misfit_sigmas.std() == pytest.approx(1.0, abs=4 / np.sqrt(2 * records) + 0.02)  # a little skew
    assert found.residual_mv.mean() == pytest.approx(np.sqrt(pulse.variance(amplitude_mv).mean() / sweeps), rel=0.03)


@pytest.mark.parametrize(("amplitude_mv", "sweeps"), [(3.0, 1), (12.0, 1), (45.0, 8)])
def test_the_covariance_is_the_bound_and_that_of_repeated_fits(
    pulse: OnePulse, amplitude_mv: float, sweeps: int
) -> None:
    bound = pulse.covariance(amplitude_mv) / sweeps
    scale = np.sqrt(np.outer(np.diag(bound), np.diag(bound)))
    exact = pulse.fit(pulse.signal(DELAY_PS, amplitude_mv)[None], DELAY_PS, amplitude_mv, sweeps)
    np.testing.assert_allclose(exact.covariance[0] / scale, bound / scale, atol=0.01)
    records = 4000
    found = pulse.fit(pulse.noisy(amplitude_mv, records, seed=5, sweeps=sweeps), DELAY_PS, amplitude_mv, sweeps)
    errors = np.stack([found.delay_ps - DELAY_PS, found.amplitude_mv - amplitude_mv, found.baseline_mv - 1.5])
    atol = 5 / np.sqrt(records) if amplitude_mv > 10 else 0.25  # a weak pulse's delay is not linear in its noise
    np.testing.assert_allclose(np.cov(errors) / scale, bound / scale, atol=atol)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_misfired_samples_are_left_out(pulse: OnePulse, count: int) -> None:
    good = pulse.noisy(45.0, 300, seed=7)
    bad = good.copy()
    at = [36, 40, 90][:count]
    bad[:, at] -= 15 * np.sqrt(pulse.variance(45.0))[at]
    every = np.ones(len(bad))
    never = replace(SETTINGS, outlier_sigmas=1e9)
    clean, found = pulse.fit(good), pulse.fit(bad)
    struck = fit_pulses(bad, pulse.table, DELAY_PS * every, 45.0 * every, every, never)
    left, without = (abs((fit.delay_ps - clean.delay_ps).mean()) for fit in (found, struck))
    # They are replaced by a fit that they have moved, so that some of their pull is left: here less than a fifth.
    assert left < without / 5
    assert left < 0.3 * np.sqrt(clean.covariance[:, 0, 0].mean())
    assert found.misfit_sigmas.max() < 6 < struck.misfit_sigmas.min()


@pytest.mark.parametrize("floor_mv", [0.03, 8.0])
def test_what_is_far_off_is_counted_in_standard_deviations(receiver: Receiver, floor_mv: float) -> None:
    pulse = OnePulse(receiver, ShotNoise(floor_mv=floor_mv))
    good = pulse.noisy(45.0, 60, seed=15)
    bad = good.copy()
    bad[:, 36] -= 15 * floor_mv
    moved = (pulse.fit(bad).delay_ps - pulse.fit(good).delay_ps) / np.sqrt(pulse.covariance(45.0)[0, 0])
    assert np.abs(moved).mean() < 0.4
    assert pulse.fit(good).misfit_sigmas.max() < 5
    assert pulse.fit(bad).misfit_sigmas.max() < 6


def test_many_samples_off_are_another_shape_and_stay(pulse: OnePulse) -> None:
    bad = pulse.noisy(45.0, 600, seed=9)
    bad[:, 30:46:2] += 15 * np.sqrt(pulse.variance(45.0))[30:46:2]  # 8 of 160, more than 2 %
    assert pulse.fit(bad).misfit_sigmas.min() > 6


def test_in_a_short_piece_two_samples_may_be_left_out(receiver: Receiver, pulse: OnePulse) -> None:
    samples = 60  # 2 % of it is one sample
    bad = pulse.noisy(45.0, 100, seed=11)[:, :samples]
    bad[:, [36, 52]] += 15 * np.sqrt(pulse.variance(45.0))[[36, 52]]
    assert pulse.fit(bad).misfit_sigmas.max() < 6


def test_records_do_not_change_each_other(pulse: OnePulse) -> None:
    pieces = np.vstack([pulse.noisy(45.0, 6, seed=13), np.zeros((2, SAMPLES)), pulse.noisy(30.0, 4, seed=14)])
    pieces[3, 38] += 20.0
    together = pulse.fit(pieces, DELAY_PS + 20.0, 40.0)
    for k in range(len(pieces)):
        alone = pulse.fit(pieces[k : k + 1], DELAY_PS + 20.0, 40.0)
        for one, all_ in zip(alone[:6], together[:6], strict=True):
            np.testing.assert_allclose(one[0], all_[k], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("level_mv", [0.0, -40.0, 111.5])
def test_where_there_is_no_pulse_the_fit_stays_finite(pulse: OnePulse, level_mv: float) -> None:
    found = pulse.fit(np.full((1, SAMPLES), level_mv), DELAY_PS, 45.0)
    assert all(np.isfinite(values).all() for values in found[:6])
    assert abs(found.delay_ps[0] - DELAY_PS) <= SETTINGS.max_steps * SETTINGS.max_move_ps + 1.0
    assert abs(found.amplitude_mv[0]) < 5 * np.sqrt(found.covariance[0, 1, 1]) + 1e-6
    assert found.baseline_mv[0] == pytest.approx(level_mv, abs=1.0)


@pytest.mark.parametrize("sweeps", [1, 8])
def test_more_sweeps_divide_the_covariance(pulse: OnePulse, sweeps: int) -> None:
    piece = pulse.signal(DELAY_PS, 45.0)[None]
    one, many = pulse.fit(piece), pulse.fit(piece, sweeps=sweeps)
    np.testing.assert_allclose(many.covariance * sweeps, one.covariance)
