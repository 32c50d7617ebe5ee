"""Evaluations of the bench procedures on readings whose answer is known."""

from __future__ import annotations

import datetime

import numpy as np
import pytest
from scipy import stats

from picoradar.instrument.calibration import Calibration, ScannerErrors, Walk, differences, out_of_date
from picoradar.instrument.procedures import PROCEDURES
from picoradar.instrument.procedures.current_pulse import current_finding, measured_current
from picoradar.instrument.procedures.drift import allan_deviation, warm_after
from picoradar.instrument.procedures.prism.body import distances, model_points
from picoradar.instrument.procedures.station.certainty import (
    largest_by_noise,
    root_mean_square_by_noise,
    too_coarse,
)
from picoradar.instrument.procedures.station.findings import lost_readings
from picoradar.instrument.procedures.station.light import Light
from picoradar.instrument.procedures.transmitter import measured
from picoradar.instrument.settings import Settings, override

DATE = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
CALIBRATION = Calibration(
    date=DATE,
    provenance="test",
    serial_numbers={"sampler": "SB-1"},
    diode_degc=23.0,
    mirror_separation_mm=30.0,
    walk={"half-maximum": Walk(response_mv=(10.0, 60.0), error_mm=(5.0, 0.0), sd_mm=(0.1, 0.1))},
)


def test_every_procedure_of_the_contract_is_there() -> None:
    bench = {"transmitter", "distance", "gray-target", "scanner", "geometry", "prism", "drift", "templates"}
    assert bench | {"penetration", "zero"} == set(PROCEDURES)


def test_allan_deviation_of_a_ramp_and_of_white_noise() -> None:
    times, ramp = allan_deviation(0.5 * np.arange(40.0), 10.0)
    np.testing.assert_allclose(ramp, 0.05 * times / np.sqrt(2))  # drift D gives D tau / sqrt 2 (NIST SP 1065)
    times, white = allan_deviation(np.random.default_rng(1).normal(0, 1, 6000), 1.0)
    np.testing.assert_allclose(white[:6], times[:6] ** -0.5, rtol=0.06)


def test_the_end_of_a_warm_up_is_found() -> None:
    times = 120.0 * np.arange(60.0)
    wander = np.random.default_rng(2).normal(0, 1.0, 60)
    assert warm_after(times, wander) == 0.0
    assert warm_after(times, wander + 40 * np.exp(-times / 600.0)) == pytest.approx(1320.0, abs=360.0)
    assert warm_after(times, wander + times / 100.0) is None


def test_a_gaussian_light_pulse_is_measured() -> None:
    times = 3000.0 + 2.5 * np.arange(1400)
    trace = 80 * np.exp(-4 * np.log(2) * ((times - 4500) / 44.0) ** 2)
    pulse = measured(Light(trace, times, mean_power_mw=0.3), 290.0, 23.0, 80e3)
    assert pulse.fwhm_ps == pytest.approx(44.0, abs=0.3)
    assert pulse.rise_ps == pytest.approx(0.7164 * 44.0, abs=0.5)
    assert pulse.energy_nj == pytest.approx(3.75)
    assert pulse.peak_w == pytest.approx(3.75e3 / 0.62 / (1.0645 * 44.0), rel=0.01)


def current_light(scale: float = 1.0, start_ps: float = 0.0) -> Light:
    """A pulse of 20 A with Gaussian flanks, 1.5 ns (sigma) up and 1 ns down, its peak at 5 ns, with noise of 0.01 A."""
    times = start_ps + 10.0 * np.arange(1200)
    sigma = np.where(times < 5000.0, 1500.0, 1000.0)
    noise = np.random.default_rng(4).normal(0.0, 0.01, len(times))
    trace = scale * 20.0 * np.exp(-0.5 * ((times - 5000.0) / sigma) ** 2) + noise
    return Light(trace, times, 0.3, current_a=trace, current_times_ps=times)


def test_a_current_pulse_is_measured() -> None:
    pulse = measured_current(current_light(), 80e3)
    assert pulse is not None
    assert pulse.peak_a == pytest.approx(20.0, abs=0.02)
    assert pulse.fwhm_ns == pytest.approx(np.sqrt(2 * np.log(2)) * (1.5 + 1.0), abs=0.01)
    rise = np.sqrt(-2 * np.log(0.1)) - np.sqrt(-2 * np.log(0.9))
    assert pulse.rise_ns == pytest.approx(1.5 * rise, abs=0.02)
    assert pulse.half_ns == pytest.approx(5.0 - 1.5 * np.sqrt(2 * np.log(2)), abs=0.01)


@pytest.mark.parametrize(
    "light",
    [Light(np.ones(3), np.arange(3.0), 0.3), current_light(scale=0.0), current_light(start_ps=4500.0)],
    ids=["not wired", "no pulse", "half of it outside"],
)
def test_what_is_no_whole_current_pulse_is_not_measured(light: Light) -> None:
    assert measured_current(light, 80e3) is None
    assert "was not measured" in current_finding([])


def test_distances_from_the_prism() -> None:
    places = model_points().reshape(-1, 3)
    beams = np.broadcast_to([0.0, 0.0, -1.0], places.shape)
    lifted = places + [0.0, 0.0, 0.5]
    found = distances(lifted, beams)
    np.testing.assert_allclose(found.along, 0.5, atol=1e-9)
    np.testing.assert_allclose(found.perpendicular, 0.5 / np.sqrt(5), atol=1e-9)
    assert distances(places, beams).splatted.mean() == pytest.approx(0.5, abs=0.06)  # what exact points give


def test_lost_readings_are_said_in_words() -> None:
    assert lost_readings(80, 100, "the plate") == ""
    assert "50 of 100" in lost_readings(50, 100, "the plate")
    assert "lid is closed" in lost_readings(0, 100, "the plate")


@pytest.mark.parametrize("count", [1, 11, 400])
def test_the_largest_of_many_means_and_what_noise_alone_gives(count: int) -> None:
    assert largest_by_noise(count) == pytest.approx(stats.norm.isf(0.01 / count / 2), rel=1e-9)
    exceeded = 1 - (1 - 2 * stats.norm.sf(largest_by_noise(count))) ** count
    assert exceeded == pytest.approx(0.01, rel=0.01)


@pytest.mark.parametrize("count", [20, 49, 576])
def test_the_residuals_of_a_plane_and_what_noise_alone_gives(count: int) -> None:
    exact = (stats.chi2.isf(0.01, count - 3) / (count - 3)) ** 0.5
    assert root_mean_square_by_noise(count, 3) == pytest.approx(exact, rel=0.002)


def test_means_that_are_too_uncertain_for_a_limit_are_not_judged() -> None:
    assert too_coarse("it", 0.025, 0.1) == ""
    assert "Take 1.4 times as many" in too_coarse("it", 0.03, 0.1)  # (4 x 0.03 / 0.1) squared
    assert "to judge it" in too_coarse("it", float("nan"), 0.1)


def test_a_calibration_of_another_instrument_temperature_or_year_is_out_of_date() -> None:
    here = {"sampler": "SB-1"}
    assert out_of_date(CALIBRATION, Settings(), here, DATE + datetime.timedelta(days=1)) == []
    assert "SB-2" in out_of_date(CALIBRATION, Settings(), {"sampler": "SB-2"})[0]
    warmer = override(Settings(), {"diode": {"target_degc": 24.0}})
    assert "24" in out_of_date(CALIBRATION, warmer, here)[0]
    assert "days old" in out_of_date(CALIBRATION, Settings(), here, DATE + datetime.timedelta(days=365))[0]
    shapes = override(Settings(), {"scan": {"estimator": "template"}})
    assert "pulse shapes" in out_of_date(CALIBRATION, shapes, here)[0]


def test_two_calibrations_are_compared_in_millimetres() -> None:
    other = CALIBRATION.model_copy(update={"range_zero_mm": 0.2, "scanner": ScannerErrors(x_offset_rad=1e-3)})
    found = differences(CALIBRATION, other)
    assert found["same"] == "no"
    assert found["half_maximum_range_largest_mm"] == pytest.approx(0.2)
    assert found["template_range_largest_mm"] is None
    assert found["point_largest_mm"] == pytest.approx(0.93, abs=0.02)
    assert differences(CALIBRATION, CALIBRATION)["same"] == "yes"
    assert found["instrument"] == "the same"
    elsewhere = CALIBRATION.model_copy(update={"serial_numbers": {"sampler": "SB-2"}})
    assert differences(CALIBRATION, elsewhere)["instrument"] == "another"
