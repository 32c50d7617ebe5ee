"""From sampling instants to sums of codes."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.sim.physics import TABLE_PS
from picoradar.sim.physics.receiver import Pulse
from picoradar.sim.physics.sampler import add_pulse, digitise
from picoradar.sim.settings import SimulationSettings

SETTINGS = SimulationSettings(adc_offset_codes=0.0, adc_bow_codes=0.0)
INSTANTS = 6500.0 + 6.7 * np.arange(400)


def ramp(begin_ps=6950.0, peak_mv=40.0, length_ps=500.0):
    shape = np.interp(
        np.arange(0, length_ps + TABLE_PS, TABLE_PS), [0, length_ps / 2, length_ps], [0, peak_mv, 0]
    ).astype(np.float32)
    return Pulse(shape, begin_ps, peak_mv)


def sampled(pulse):
    signal, slope = np.zeros((2, 400))
    add_pulse(signal, slope, 6500.0, 6.7, pulse)
    return signal, slope


def test_a_pulse_is_sampled_where_it_is():
    signal, slope = sampled(ramp())
    np.testing.assert_allclose(signal, np.interp(INSTANTS, [6950.0, 7200.0, 7450.0], [0.0, 40.0, 0.0]), atol=0.03)
    rising = (INSTANTS > 6952) & (INSTANTS < 7198)
    np.testing.assert_allclose(slope[rising], 40.0 / 250.0, rtol=1e-3)


def test_pulses_add_up():
    signal, slope = np.zeros((2, 400))
    for pulse in (ramp(), ramp(7300.0)):
        add_pulse(signal, slope, 6500.0, 6.7, pulse)
    np.testing.assert_allclose(signal, sampled(ramp())[0] + sampled(ramp(7300.0))[0])


@pytest.mark.parametrize("begin_ps", [20000.0, -5000.0])
def test_a_pulse_outside_the_window_leaves_no_trace(begin_ps):
    signal, slope = sampled(ramp(begin_ps))
    assert not signal.any()
    assert not slope.any()


def test_a_pulse_cut_by_the_window_is_seen_in_part():
    signal, _ = sampled(ramp(6300.0))
    assert signal[0] == pytest.approx(32.0, abs=0.1)


def test_codes_of_known_voltages():
    volts = np.array([[0.0, 0.24, 0.26, 16.0, -8.0], [0.0, 0.0, 0.0, 0.0, 0.0]], dtype=np.float32)
    sums, clipped = digitise(volts, SETTINGS)
    np.testing.assert_array_equal(sums, [64, 64, 65, 96, 48])
    assert sums.dtype == np.uint32
    assert not clipped


@pytest.mark.parametrize(("level_mv", "code"), [(200.0, 255), (111.5, 255), (-16.0, 0), (-50.0, 0)])
def test_ends_of_the_range_clip(level_mv, code):
    sums, clipped = digitise(np.full((2, 3), level_mv, dtype=np.float32), SETTINGS)
    np.testing.assert_array_equal(sums, 2 * code)
    assert clipped


def test_sums_of_many_sweeps_are_exact():
    sums, _ = digitise(np.full((256, 2), 105.0, dtype=np.float32), SETTINGS)
    np.testing.assert_array_equal(sums, 256 * 242)


def test_offset_and_bow_of_the_converter():
    bent = SimulationSettings(adc_offset_codes=2.0, adc_bow_codes=4.0)
    ideal = np.array([[0.0, 126.0, 254.0]], dtype=np.float32)
    sums, _ = digitise(((ideal - 32.0) * 0.5).astype(np.float32), bent)
    np.testing.assert_array_equal(sums, [2, 132, 255])
