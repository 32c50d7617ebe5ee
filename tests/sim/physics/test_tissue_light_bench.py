"""Light in tissue on the bench of physics: later echoes, hidden truth untouched, off means off."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from picoradar.sim.physics import Noise, Receiver, build_scene
from picoradar.sim.physics.spread import AT_ONCE, Late, Spread, convolved, placed
from picoradar.sim.settings import SimulationSettings

STRAIGHT = (0.0, 0.0, 900.0, 0.0, 0.0, 0.0)
STILL = {"repeatability_deg": 0.0, "drift_ps": 0.0, "target_pose": STRAIGHT, "surface_share": (0.0, 0.0)}


def bias_mm(make_bench, x_mm, readings=60, **changes):
    """Mean of range less truth, up to the zero of the radar, at a place of the coated piece; and the response."""
    bench = make_bench(target="coated", **{**STILL, **changes})
    bench.mirrors.command(x_mm / 900.0 / np.radians(5.0), 0.0)
    bench.clock.sleep(0.1)
    found = [bench.interval_mm(number) for number in range(1, readings + 1)]
    truth = bench.optics.truth[(1, 0, 0)]
    return np.mean(found) - truth.range_mm, truth


def side(make_bench, **changes):
    """Sign of x at which the piece is bare: where the beam goes further."""
    ranges = [bias_mm(make_bench, x, 1, **changes)[1].range_mm for x in (-10.0, 10.0)]
    assert abs(ranges[0] - ranges[1]) > 0.05
    return 1.0 if ranges[1] > ranges[0] else -1.0


@pytest.mark.parametrize(("material", "low", "high"), [("bone", 3.5, 4.6), ("cartilage", 3.0, 4.0), ("fat", 4.2, 5.4)])
def test_the_bare_half_reads_millimetres_too_far(make_bench, material, low, high):
    bare = side(make_bench)
    dark, _ = bias_mm(make_bench, 10.0 * bare, sample_material=material)
    light, lit = bias_mm(make_bench, 10.0 * bare, sample_material=material, tissue_light=True)
    assert low < light - dark < high
    assert lit.range_mm == bias_mm(make_bench, 10.0 * bare, 1, sample_material=material)[1].range_mm


def test_the_coated_half_hardly_does(make_bench):
    coat = -10.0 * side(make_bench)
    dark, light = (bias_mm(make_bench, coat, tissue_light=light)[0] for light in (False, True))
    assert abs(light - dark) < 0.15


def test_coat_stands_by_its_thickness_over_the_piece(make_bench):
    bare = side(make_bench)
    ranges = [bias_mm(make_bench, x * bare, 1, coat_mm=0.3)[1].range_mm for x in (10.0, -10.0)]
    assert ranges[0] - ranges[1] == pytest.approx(0.3, abs=1e-3)


def test_a_share_of_surface_light_takes_bias_away_and_varies_from_place_to_place(make_bench):
    bare = side(make_bench)
    none, much = (bias_mm(make_bench, 10.0 * bare, tissue_light=True, surface_share=(f, f))[0] for f in (0.0, 0.3))
    assert 0.8 < none - much < 1.8
    places = [
        bias_mm(make_bench, x * bare, 30, tissue_light=True, surface_share=(0.0, 0.4))[0]
        for x in np.linspace(4.0, 16.0, 7)
    ]
    assert np.ptp(places) > 0.4


def test_samples_of_tissue_differ_and_repeat(make_bench):
    bare = side(make_bench)
    first, again, other, typical = (
        bias_mm(make_bench, 10.0 * bare, 20, tissue_light=True, tissue_sample=n) for n in (5, 5, 6, 0)
    )
    assert first[0] == again[0]
    assert abs(first[0] - other[0]) > 0.02
    assert first[1].response_mv != typical[1].response_mv
    same = bias_mm(make_bench, 10.0 * bare, 20, tissue_light=True, tissue_sample=5, tissue_spread=0.0)
    assert same[0] == pytest.approx(typical[0], abs=1e-9)


def test_the_echo_keeps_its_energy(make_bench):
    """Late light is late, not lost: the area under the pulse stays, its peak falls by some percent."""
    charges, arrivals = np.array([400.0]), np.zeros(1)
    receiver = Receiver(SimulationSettings(saturation_mv=1e4, slow_rise_excess=0.0001))
    late = np.exp(-np.arange(400) / 60.0).astype(np.float32)
    late /= late.sum()
    (plain,) = receiver.pulses(arrivals, charges, 44.0)
    (spread,) = receiver.pulses(arrivals, charges, 44.0, [Late(0.0, Spread(late))])
    assert spread.shape.sum(dtype=float) == pytest.approx(plain.shape.sum(dtype=float), rel=1e-3)
    assert 0.85 * plain.response_mv < spread.response_mv < 0.999 * plain.response_mv
    delay = [np.arange(len(p.shape)) @ p.shape.astype(float) / p.shape.sum(dtype=float) for p in (plain, spread)]
    assert delay[1] - delay[0] == pytest.approx(np.arange(400) @ late, abs=0.2)


def test_the_walk_goes_by_the_peak_of_the_spread_echo():
    """An echo of 19.5 mV without the tissue has 13.8 mV with it, and so the slow rise of a weaker echo."""
    receiver, arrivals = Receiver(SimulationSettings(saturation_mv=1e4)), np.zeros(1)
    late = np.exp(-np.arange(1500) / 300.0).astype(np.float32)
    spread = Spread(late / late.sum())
    charges = np.array([220.0])
    (plain,) = receiver.pulses(arrivals, charges, 44.0)
    (found,) = receiver.pulses(arrivals, charges, 44.0, [Late(0.0, spread)])
    fast = convolved(plain.shape, spread)
    (weak,) = receiver.pulses(arrivals, charges * float(fast.max()) / plain.response_mv, 44.0)
    slow = convolved(weak.shape, spread) * (plain.response_mv / float(fast.max()))
    np.testing.assert_allclose(found.shape, slow, atol=2e-3 * found.response_mv)
    assert np.abs(found.shape - fast).max() > 0.02 * found.response_mv


def test_light_at_once_changes_nothing():
    """Rays whose light all comes at once give the pulse of rays without a response, wherever they lie."""
    receiver = Receiver(SimulationSettings())
    for arrivals in ([0.0, 3.0, 1.0], [40.0, 0.0, 90.3], [0.0, 500.0, 520.0]):
        charges = np.array([300.0, 0.0, 200.0])
        plain = receiver.pulses(np.array(arrivals), charges, 44.0)
        spread = receiver.pulses(np.array(arrivals), charges, 44.0, [Late(0.25, AT_ONCE)] * 3)
        for a, b in zip(plain, spread, strict=True):
            assert b.begin_ps == pytest.approx(a.begin_ps)
            np.testing.assert_allclose(b.shape[: len(a.shape)], a.shape, atol=2e-4 * a.response_mv)


def test_light_keeps_its_spread_and_mean_arrival_on_the_grid():
    first, second = (Spread(np.full(n, 1 / n, dtype=np.float32)) for n in (3, 50))
    lates = [Late(0.0, first), Late(0.2, second), Late(0.2, second)]
    start, parts = placed(np.array([10.0, 30.5, 33.0]), np.array([0.25, 0.5, 0.25]), lates)
    share, sums = (dict.fromkeys((AT_ONCE, first, second), 0.0) for _ in range(2))
    for (spread, entry), part in parts.items():
        share[spread] += part
        sums[spread] += part * (start + entry)
    rest = 0.5 * 30.5 + 0.25 * 33.0
    assert list(share.values()) == pytest.approx([0.15, 0.25, 0.6])
    assert list(sums.values()) == pytest.approx([0.2 * rest, 0.25 * 10.0, 0.8 * rest])


def test_convolution_is_that_of_the_sums():
    rng = np.random.default_rng(1)
    shape, light = rng.random(300).astype(np.float32), rng.random(70).astype(np.float32)
    expected = np.convolve(shape.astype(float), light.astype(float))
    expected[[0, -1]] = 0.0
    np.testing.assert_allclose(convolved(shape, Spread(light)), expected, rtol=1e-4, atol=1e-3)


def test_off_ignores_every_setting_of_light_in_tissue(make_bench):
    plain = make_bench(target="hip", seed=3)
    other = make_bench(target="hip", seed=3, receiver_view_mm=9.0, surface_share=(0.1, 0.2), tissue_sample=4)
    np.testing.assert_array_equal(plain.record(1), other.record(1))
    lit = make_bench(target="hip", seed=3, tissue_light=True)
    assert not np.array_equal(plain.record(2), lit.record(2))


def test_steel_lets_no_light_in_and_a_miss_stays_a_miss(make_bench):
    for light in (False, True):
        bench = make_bench(target="prism", tissue_light=light)
        bench.mirrors.command(0.9, 0.9)
        bench.clock.sleep(1.0)
        bench.record(1)
        assert bench.optics.truth[(1, 0, 0)].response_mv == 0.0
    scene = build_scene(SimulationSettings(surgical=True), Noise(1))
    assert [m.inside for m in scene.target.materials].count(None) == 2  # the two retractors


def test_shares_in_the_wrong_order_are_refused():
    with pytest.raises(ValidationError, match=r"the least, 0\.5, is above the largest, 0\.2"):
        SimulationSettings(surface_share=(0.5, 0.2))
