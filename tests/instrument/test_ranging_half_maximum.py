"""The 50 % point of a parabola between samples: crossing, height and all variances in closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from picoradar.instrument.calibration import ShotNoise
from picoradar.instrument.ranging import RangingSettings
from picoradar.instrument.ranging.half_maximum import Edges, half_maximum, join
from picoradar.instrument.ranging.pulses import CoarseTraces, Pulses

SETTINGS = RangingSettings()
STEP_PS, BASE_MV, HEIGHT_MV = 10.0, 3.0, 40.0
TIMES = 6500.0 + STEP_PS * np.arange(200)
PEAK_PS, HALF_WIDTH_PS = 7503.7, 400.0
NOISE = ShotNoise(floor_mv=0.0, signal_mv=0.02, signal_share=0.015, jitter_ps=2.5)


def parabola(peak_ps: float = PEAK_PS, height_mv: float = HEIGHT_MV) -> np.ndarray:
    return BASE_MV + height_mv * np.maximum(1 - ((TIMES - peak_ps) / HALF_WIDTH_PS) ** 2, -0.2)


def edges(
    trace: np.ndarray, peak_bin: int = 20, *, found: bool = True, noise: ShotNoise = NOISE, noise_mv: float = 0.3
) -> Edges:
    one = np.ones(1)
    coarse = CoarseTraces(trace[None], 5, 50.0, BASE_MV * one, 0.01 * one, noise_mv * one, 2.0 * one)
    at = np.array([peak_bin])
    pulses = Pulses(np.array([found]), at, at, at, one, one)
    return half_maximum(trace[None], TIMES, coarse, pulses, noise, 8.0 * one, SETTINGS)


def numbers(own: Edges) -> dict[str, float]:
    return {name: float(value[0]) for name, value in vars(own).items()}


def fit_variance(half: int) -> float:
    """Variance of a fitted parabola's vertex for unit noise, over the samples about the one next to the peak."""
    middle = round((PEAK_PS - TIMES[0]) / STEP_PS)
    about = TIMES[middle - half : middle + half + 1] - PEAK_PS
    design = np.stack([np.ones_like(about), about, about**2], axis=1)
    return float(np.linalg.inv(design.T @ design)[0, 0])


@pytest.mark.parametrize("peak_bin", [19, 20, 21])  # the coarse peak may be a bin off
def test_a_parabola_is_found_with_all_its_variances(peak_bin: int) -> None:
    found = numbers(edges(parabola(), peak_bin))
    exact_ps = PEAK_PS - HALF_WIDTH_PS * math.sqrt(0.5)
    low = int((exact_ps - TIMES[0]) // STEP_PS)
    level, v0, v1 = BASE_MV + HEIGHT_MV / 2, *parabola()[low : low + 2]
    share = (level - v0) / (v1 - v0)
    slope = 2 * HEIGHT_MV * (PEAK_PS - TIMES[low]) / HALF_WIDTH_PS**2

    def variance(signal_mv: float, slope: float) -> float:
        return 0.3**2 + (0.02 * signal_mv + (0.015 * signal_mv) ** 2 + (2.5 * slope) ** 2) / 8

    height = fit_variance(8) * variance(HEIGHT_MV, 0.0)
    sample = variance(HEIGHT_MV / 2, slope)
    rise = slope * STEP_PS / math.sqrt(sample)
    assert rise > 3.0  # one crossing
    edge = ((1 - share) ** 2 + share**2) * sample
    assert found == pytest.approx(
        {
            "time_ps": TIMES[low] + share * STEP_PS,
            "time_variance_ps2": (edge + height / 4) / slope**2,
            "height_mv": HEIGHT_MV,
            "height_variance_mv2": height + 0.01,
            "covariance_ps_mv": (height - 0.01) / (2 * slope),
            "baseline_ps_per_mv": 0.5 / slope,
        },
        rel=1e-9,
    )
    assert found["time_ps"] == pytest.approx(exact_ps, abs=0.1)


def test_several_crossings_scatter_less_by_the_tabulated_share() -> None:
    quiet, loud = (numbers(edges(parabola(), noise=ShotNoise(), noise_mv=n)) for n in (1e-3, 1.135))
    slope = 0.5 / loud["baseline_ps_per_mv"]
    assert slope * STEP_PS / 1.135 == pytest.approx(1.25, abs=0.02)
    height = (loud["height_variance_mv2"] - 0.01) / 4 / slope**2
    quiet_height = (quiet["height_variance_mv2"] - 0.01) / 4 / slope**2
    edge = (loud["time_variance_ps2"] - height) / 1.135**2
    assert edge / ((quiet["time_variance_ps2"] - quiet_height) / 1e-6) == pytest.approx(0.911, abs=2e-3)


def test_a_trace_without_noise_has_one_crossing_and_no_variance() -> None:
    found = numbers(edges(parabola(), noise=ShotNoise(), noise_mv=0.0))
    assert found["time_variance_ps2"] == 0.0
    assert found["height_variance_mv2"] == 0.01


@pytest.mark.parametrize(
    ("trace", "found"),
    [
        (parabola(), False),  # no pulse was found
        (parabola(height_mv=-40.0), True),
        (parabola(TIMES[0] + 150.0), True),  # begins above half of the peak
        (np.full(200, BASE_MV), True),
        (BASE_MV + np.where(TIMES < 6600.0, 0.0, 30.0) + parabola(height_mv=10.0) - BASE_MV, True),  # no edge near
    ],
)
def test_without_a_crossing_there_is_no_time(trace: np.ndarray, *, found: bool) -> None:
    at = 3 if trace[15] > 40.0 and trace[0] > 20.0 else 20
    own = numbers(edges(trace, at, found=found))
    for name in ("time_ps", "time_variance_ps2", "height_mv", "covariance_ps_mv", "baseline_ps_per_mv"):
        assert math.isnan(own[name]), name


@pytest.mark.parametrize(("edge_ps", "crossed"), [(740.0, True), (750.0, False)])
def test_an_edge_is_looked_for_over_750_ps(edge_ps: float, *, crossed: bool) -> None:
    """Back from the middle sample of the coarse peak's bin."""
    middle_ps = TIMES[20 * 5 + 2]
    flat = BASE_MV + np.where(middle_ps - edge_ps + 5.0 > TIMES, 0.0, 40.0 - 1e-5 * (TIMES - middle_ps) ** 2)
    assert math.isfinite(numbers(edges(flat))["time_ps"]) == crossed


def test_a_pulse_at_either_end_of_the_trace_is_fitted_with_the_samples_there() -> None:
    late = TIMES[-1] - 30.0
    found = numbers(edges(parabola(late), 39))
    assert found["height_mv"] == pytest.approx(HEIGHT_MV)
    assert found["time_ps"] == pytest.approx(late - HALF_WIDTH_PS * math.sqrt(0.5), abs=0.1)


def open_parabola(times_ps: np.ndarray, peak_ps: float, half_width_ps: float) -> np.ndarray:
    """A parabola that goes on below the baseline, so that it is one wherever it is fitted."""
    return BASE_MV + HEIGHT_MV * (1 - ((times_ps - peak_ps) / half_width_ps) ** 2)


def edge_of(trace: np.ndarray, times_ps: np.ndarray, peak: int) -> dict[str, float]:
    """The edge of a trace whose bins are its samples, without noise of the baseline."""
    one, at = np.ones(1), np.array([peak])
    coarse = CoarseTraces(trace[None], 1, times_ps[1] - times_ps[0], BASE_MV * one, 0.0 * one, one, 2.0 * one)
    pulses = Pulses(np.array([True]), at, at, at, one, one)
    return numbers(half_maximum(trace[None], times_ps, coarse, pulses, ShotNoise(), one, SETTINGS))


def vertex_variance(about_ps: np.ndarray) -> float:
    design = np.stack([np.ones_like(about_ps), about_ps, about_ps**2], axis=1)
    return float(np.linalg.inv(design.T @ design)[0, 0])


@pytest.mark.parametrize("samples", [65, 66])
def test_a_trace_of_fine_steps_is_fitted_as_a_whole(samples: int) -> None:
    """All samples about the middle one; of an even number the one farthest from peak or edge is left out."""
    times = 6500.0 + np.arange(float(samples))
    found = edge_of(open_parabola(times, 6540.0, 40.0), times, 40)
    assert found["height_mv"] == pytest.approx(HEIGHT_MV)
    assert found["height_variance_mv2"] == pytest.approx(vertex_variance(times[-65:] - 6540.0))
    slope = 2 * HEIGHT_MV * (6540.0 - times[32]) / 40.0**2  # in the middle of the first 65
    assert found["baseline_ps_per_mv"] == pytest.approx(0.5 / slope)


def test_an_edge_at_the_end_of_the_trace_has_the_slope_of_the_last_samples() -> None:
    found = edge_of(open_parabola(TIMES, TIMES[196], 50.0), TIMES, 196)
    slope = 2 * HEIGHT_MV * (TIMES[196] - TIMES[191]) / 50.0**2
    assert found["height_mv"] == pytest.approx(HEIGHT_MV)
    assert found["baseline_ps_per_mv"] == pytest.approx(0.5 / slope)


def test_coarse_steps_are_fitted_with_five_samples() -> None:
    times = 6500.0 + 40.0 * np.arange(70)
    trace = open_parabola(times, times[35], 300.0)
    low = 29  # 240 ps before the peak: 3 + 40 * 0.36
    trace[low - 2 : low + 3] += [1.0, 0.0, 0.5, -1.0, 2.0]
    found = edge_of(trace, times, 35)
    assert found["height_mv"] == pytest.approx(HEIGHT_MV)
    assert found["height_variance_mv2"] == pytest.approx(vertex_variance(40.0 * np.arange(-2.0, 3.0)))
    assert low == int((found["time_ps"] - times[0]) // 40.0)
    slope = (trace[low - 2] - 8 * trace[low - 1] + 8 * trace[low + 1] - trace[low + 2]) / (12 * 40.0)
    assert found["baseline_ps_per_mv"] == pytest.approx(0.5 / slope)


@pytest.mark.parametrize("step_ps", [26.0, 26.8])
def test_steps_of_a_third_of_the_edge_are_fitted_with_seven_samples(step_ps: float) -> None:
    times = 6500.0 + step_ps * np.arange(100)
    found = edge_of(open_parabola(times, times[50], 300.0), times, 50)
    assert found["height_variance_mv2"] == pytest.approx(vertex_variance(step_ps * np.arange(-3.0, 4.0)))


def test_an_edge_of_one_coarse_step_is_a_crossing_with_the_slope_of_five_samples() -> None:
    """Just before the peak's own sample: steps of 100 ps are wider than the piece that is fitted."""
    times = 6500.0 + 100.0 * np.arange(40)
    trace = BASE_MV + np.zeros(40)
    trace[20:23] += [40.0, 38.0, 16.0]
    found = edge_of(trace, times, 20)
    assert times[19] < found["time_ps"] < times[20]
    slope = (8 * 40.0 - 38.0) / (12 * 100.0)  # of the cubic through samples 17 to 21
    assert found["baseline_ps_per_mv"] == pytest.approx(0.5 / slope)


def test_the_peak_is_looked_for_within_two_half_widths_of_the_coarse_one() -> None:
    """Each of two parabolas may move by 80 ps."""
    found = numbers(edges(parabola(), 16))
    start = TIMES[16 * 5 + 2]
    assert found["height_mv"] == pytest.approx(HEIGHT_MV * (1 - ((PEAK_PS - start - 160.0) / HALF_WIDTH_PS) ** 2))


def one(**values: float) -> Any:
    return {name: np.array([value]) for name, value in values.items()}


def test_both_edges_stand_on_one_baseline() -> None:
    start = Edges(
        **one(time_ps=100.0, time_variance_ps2=2.0, height_mv=45.0, height_variance_mv2=0.3, covariance_ps_mv=0.1,
              baseline_ps_per_mv=3.0)
    )  # fmt: skip
    stop = Edges(
        **one(time_ps=4100.0, time_variance_ps2=7.0, height_mv=20.0, height_variance_mv2=0.6, covariance_ps_mv=0.2,
              baseline_ps_per_mv=8.0)
    )  # fmt: skip
    coarse = CoarseTraces(np.zeros((1, 1)), 1, 1.0, *(np.array([v]) for v in (0.0, 0.1, 0.0, 0.0)))
    found = {name: float(value[0]) for name, value in vars(join(start, stop, coarse)).items()}
    assert found == pytest.approx(
        {
            "reference_ps": 100.0,
            "reference_mv": 45.0,
            "reference_variance_ps2": 2.0 + 9.0 * 0.1,
            "echo_variance_ps2": 7.0 + 64.0 * 0.1,
            "interval_ps": 4000.0,
            "interval_variance_ps2": 9.0 + 25.0 * 0.1,
            "response_mv": 20.0,
            "response_variance_mv2": 0.6,
            "covariance_ps_mv": 0.2,
        }
    )
