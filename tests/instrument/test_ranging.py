"""Half-maximum ranging on synthetic traces: known delays, true variances, and a flag for each thing that is wrong."""

from __future__ import annotations

import datetime
import functools

import numpy as np
import pytest
from scipy.special import erf

from picoradar.instrument import ranging
from picoradar.instrument.calibration import Calibration, Walk
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import Flag
from picoradar.instrument.ranging import SPEED_OF_LIGHT_MM_PER_PS, RangingSettings
from picoradar.instrument.ranging.half_maximum import LAST_CROSSING

estimate = functools.partial(ranging.estimate, method="half-maximum")

TIMES = 6500.0 + 6.7 * np.arange(1430)
REFERENCE_PS = 7300.0


def pulse(t: np.ndarray) -> np.ndarray:
    """A pulse of unit peak, rise 210 ps, full width 600 ps: a slow error function up, a faster one down; its 50 % point
    on the leading edge lies at 0."""
    up = 0.5 * (1 + erf(t / 116.0))
    down = 0.5 * (1 - erf((t - 600.0) / 230.0))
    shape = up * down
    fine = np.linspace(-600.0, 1500.0, 21001)
    values = 0.5 * (1 + erf(fine / 116.0)) * 0.5 * (1 - erf((fine - 600.0) / 230.0))
    return shape / values.max()


def half_point() -> float:
    fine = np.linspace(-300.0, 200.0, 50001)
    return float(np.interp(0.5, pulse(fine), fine))


def trace(interval_ps: float, response_mv: float = 45.0, *, start: float = REFERENCE_PS) -> np.ndarray:
    lag = half_point()
    return 45.0 * pulse(TIMES - start + lag) + response_mv * pulse(TIMES - start - interval_ps + lag)


def noisy(clean: np.ndarray, records: int, noise_mv: float, seed: int) -> np.ndarray:
    return clean + np.random.default_rng(seed).normal(0.0, noise_mv, (records, clean.size))


def flags_of(traces: object) -> list[Flag]:
    return [Flag(int(f)) for f in estimate(traces, TIMES, calibration=CALIBRATION).flags]  # type: ignore[arg-type]


CALIBRATION = Calibration(
    date=datetime.datetime(2026, 1, 31, tzinfo=datetime.UTC),
    provenance="synthetic",
    mirror_separation_mm=30.0,
    range_zero_mm=400.0,
    walk={"half-maximum": Walk(response_mv=(15.0, 25.0, 65.0), error_mm=(3.0, 1.0, 0.0), sd_mm=(0.1, 0.05, 0.02))},
)


@pytest.mark.parametrize("interval_ps", [2000.0, 3999.99, 6123.4])
@pytest.mark.parametrize("response_mv", [10.0, 45.0, 65.0])
def test_the_interval_of_a_trace_without_noise(interval_ps: float, response_mv: float) -> None:
    found = estimate(trace(interval_ps, response_mv)[None], TIMES)
    assert found.range_mm[0] == pytest.approx(SPEED_OF_LIGHT_MM_PER_PS / 2 * interval_ps, abs=0.02)
    assert found.response_mv[0] == pytest.approx(response_mv, rel=0.01)
    assert found.reference_ps[0] == pytest.approx(REFERENCE_PS, abs=0.3)
    assert found.reference_mv[0] == pytest.approx(45.0, rel=0.01)


def test_the_speed_of_light_is_that_in_air() -> None:
    assert pytest.approx(0.2997115, abs=1e-7) == SPEED_OF_LIGHT_MM_PER_PS


@pytest.mark.parametrize(("response_mv", "latest_mm"), [(10.0, 0.5), (15.0, 0.2), (30.0, 0.05), (65.0, 0.02)])
def test_the_variance_is_that_of_repeated_readings(response_mv: float, latest_mm: float) -> None:
    traces = np.vstack([noisy(trace(3998.0 + 0.67 * k, response_mv), 300, 0.4, seed=11 + k) for k in range(10)])
    found = estimate(traces, TIMES)
    error = found.range_mm - SPEED_OF_LIGHT_MM_PER_PS / 2 * np.repeat(3998.0 + 0.67 * np.arange(10), 300)
    spread = error - error.mean()
    assert np.mean(spread**2 / found.variance_mm2) == pytest.approx(
        1.0, abs=0.08
    )  # three times 2.6 %, of 3000 readings
    # Noise makes the last crossing before the peak come late: part of the timing walk, and it falls with the response.
    assert -0.02 < error.mean() < latest_mm


@pytest.mark.parametrize("rise_sigmas", [0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0])
def test_the_last_of_several_crossings_scatters_less(rise_sigmas: float) -> None:
    edges, reach = 40_000, int(np.ceil(5 / rise_sigmas)) + 3
    rng = np.random.default_rng(7)
    place, rows = rng.random(edges), np.arange(edges)
    edge = (np.arange(-reach, reach + 1) - place[:, None]) * rise_sigmas + rng.standard_normal((edges, 2 * reach + 1))
    last = 2 * reach - np.argmax((edge < 0)[:, ::-1], axis=1)
    share = edge[rows, last] / (edge[rows, last] - edge[rows, last + 1])
    error = last - reach + share - place
    single = ((1 - share) ** 2 + share**2) / rise_sigmas**2
    factor = np.mean((error - error.mean()) ** 2 / single)
    assert np.interp(rise_sigmas, *LAST_CROSSING) == pytest.approx(factor, rel=0.03)
    assert (np.diff(LAST_CROSSING, axis=1) > 0.0).all(), "or there is no interpolation"


def test_the_walk_correction_and_the_range_zero_are_applied() -> None:
    clean = np.stack([trace(4000.0, 25.0), trace(4000.0, 60.0)])
    plain, corrected = estimate(clean, TIMES), estimate(clean, TIMES, calibration=CALIBRATION)
    walk = CALIBRATION.walk["half-maximum"].at(plain.response_mv)
    np.testing.assert_allclose(corrected.range_mm, plain.range_mm + 400.0 - walk.error_mm)
    np.testing.assert_allclose(corrected.bias_sd_mm, walk.sd_mm)
    np.testing.assert_array_equal(corrected.flags, 0)


def test_the_variance_holds_where_the_walk_is_steep() -> None:
    found = estimate(noisy(trace(4000.0, 20.0), 3000, 0.4, seed=5), TIMES, calibration=CALIBRATION)
    spread = found.range_mm - found.range_mm.mean()
    assert np.mean(spread**2 / found.variance_mm2) == pytest.approx(1.0, abs=0.15)


def test_without_a_walk_every_point_says_so() -> None:
    assert estimate(trace(4000.0)[None], TIMES).flags[0] == Flag.WALK_EXTRAPOLATED


def test_response_outside_the_walk_calibration_is_flagged() -> None:
    assert flags_of(np.stack([trace(4000.0, 70.0), trace(4000.0, 10.0)])) == [
        Flag.WALK_EXTRAPOLATED,
        Flag.WALK_EXTRAPOLATED | Flag.LOW_RESPONSE,
    ]


def test_zeros_noise_and_saturation_have_no_reference() -> None:
    noise = np.random.default_rng(2).normal(0.0, 2.0, (300, TIMES.size))
    assert flags_of(np.zeros((1, TIMES.size))) == [Flag.NO_REFERENCE]
    assert set(flags_of(noise)) == {Flag.NO_REFERENCE}
    assert flags_of(np.full((1, TIMES.size), 111.5)) == [Flag.NO_REFERENCE | Flag.CLIPPED]


def test_one_pulse_is_the_reference() -> None:
    clean = 45.0 * pulse(TIMES - REFERENCE_PS)
    assert set(flags_of(noisy(clean, 300, 0.7, seed=4))) == {Flag.NO_ECHO}


def test_three_pulses_are_mixed_and_the_first_echo_counts() -> None:
    clean = trace(4000.0) + 20.0 * pulse(TIMES - REFERENCE_PS - 5500.0)
    found = estimate(clean[None], TIMES, calibration=CALIBRATION)
    assert found.flags[0] == Flag.MIXED
    assert found.range_mm[0] == pytest.approx(estimate(trace(4000.0)[None], TIMES, calibration=CALIBRATION).range_mm[0])


def test_two_surfaces_that_widen_the_echo_are_mixed() -> None:
    clean = trace(4000.0, 25.0) + 25.0 * pulse(TIMES - REFERENCE_PS - 4450.0)
    assert Flag.MIXED in flags_of(noisy(clean, 1, 0.3, seed=8))[0]


def test_overlapping_pulses_are_flagged_and_merged_ones_have_no_range() -> None:
    assert flags_of(noisy(trace(900.0), 1, 0.3, seed=8)) == [Flag.OVERLAPPED]
    assert flags_of(noisy(trace(400.0), 1, 0.3, seed=8)) == [Flag.OVERLAPPED | Flag.NO_ECHO]


def test_wrong_length_and_nan_are_flagged_beside_good_records() -> None:
    bad = trace(4000.0)
    bad[7] = np.nan
    found = estimate([trace(4000.0), np.zeros(10), bad, np.zeros((2, 2))], TIMES, calibration=CALIBRATION)
    assert [Flag(int(f)) for f in found.flags] == [Flag.NONE, Flag.NO_REFERENCE, Flag.NO_REFERENCE, Flag.NO_REFERENCE]
    assert set(estimate(np.zeros((3, 100)), TIMES).flags) == {Flag.NO_REFERENCE}
    assert set(estimate(np.zeros((3, 20)), TIMES[:20]).flags) == {Flag.NO_REFERENCE}


def test_a_spike_is_no_echo() -> None:
    clean = 45.0 * pulse(TIMES - REFERENCE_PS)
    clean[900:906] += 60.0
    assert flags_of(noisy(clean, 1, 0.3, seed=1)) == [Flag.NO_ECHO]


def test_an_echo_cut_off_at_its_rise_has_no_range() -> None:
    assert flags_of(noisy(trace(TIMES[-1] - REFERENCE_PS), 1, 0.3, seed=1)) == [Flag.NO_ECHO]


def test_clipping_is_seen_in_the_sums_or_told_by_the_device() -> None:
    high = np.minimum(trace(4000.0, 130.0), 111.5)
    assert Flag.CLIPPED in flags_of(high[None])[0]
    told = estimate(np.stack([trace(4000.0)] * 2), TIMES, calibration=CALIBRATION, clipped=[False, True])
    assert list(told.flags) == [Flag.NONE, Flag.CLIPPED]


def test_a_pulse_in_the_wrong_place_is_not_the_reference() -> None:
    placed = CALIBRATION.model_copy(update={"reference_ps": (7200.0, 7400.0)})
    found = estimate(np.stack([trace(4000.0), trace(3000.0, start=9000.0)]), TIMES, calibration=placed)
    assert [Flag(int(f)) for f in found.flags] == [Flag.NONE, Flag.NO_REFERENCE]


def test_no_range_without_a_warrant() -> None:
    rng = np.random.default_rng(9)
    some = rng.normal(0, 1, (200, TIMES.size)) + rng.uniform(0, 60, (200, 1)) * pulse(TIMES - REFERENCE_PS)
    found = estimate(some, TIMES, calibration=CALIBRATION)
    refused = (found.flags & (Flag.NO_ECHO | Flag.NO_REFERENCE)) != 0
    assert refused.all()
    for values in (found.range_mm, found.variance_mm2, found.response_mv, found.bias_sd_mm):
        assert np.isnan(values).all()


def test_records_do_not_depend_on_their_neighbours() -> None:
    traces = noisy(trace(4000.0), 300, 0.5, seed=6)
    together, alone = estimate(traces, TIMES), estimate(traces[200:201], TIMES)
    assert together.range_mm[200] == pytest.approx(alone.range_mm[0], abs=1e-9)


def test_misuse_is_refused() -> None:
    good = trace(4000.0)[None]
    with pytest.raises(BadInput, match="evenly spaced"):
        estimate(good, TIMES[::-1])
    with pytest.raises(BadInput, match="one row a record"):
        estimate(good[0], TIMES)
    with pytest.raises(BadInput, match="'guess' is not known"):
        estimate(good, TIMES, method="guess")
    with pytest.raises(BadInput, match="at least 1"):
        estimate(good, TIMES, sweeps=0)
    with pytest.raises(BadInput, match="one a record"):
        estimate(good, TIMES, clipped=[True, False])
    assert estimate(np.empty((0, TIMES.size)), TIMES).range_mm.shape == (0,)


def test_the_limits_can_be_set() -> None:
    strict = RangingSettings(low_response_mv=50.0)
    assert estimate(trace(4000.0)[None], TIMES, calibration=CALIBRATION, settings=strict).flags[0] == Flag.LOW_RESPONSE
