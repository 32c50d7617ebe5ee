"""Light that comes back late: how far it stretches each echo.

The synthetic receiver's own pulse, and light that is late by a formula of these tests: a gamma distribution of two
stages, with nothing of the simulator's tables.
"""

from __future__ import annotations

import datetime

import numpy as np
import pytest
from scipy.stats import gamma

from picoradar.instrument.calibration import Calibration, Material, Stretch
from picoradar.instrument.line import Flag
from picoradar.instrument.ranging import (
    Ranges,
    WindowTraces,
    estimate,
    estimate_windows,
    learn_stretch,
    left_of_echoes,
)
from tests.instrument.conftest import SyntheticReceiver

INTERVAL_PS = 4150.7
ECHO_MV, SWEEPS, RECORDS = 45.0, 8, 300
PIECE_PS = 10.0  # of each of the two stages, of the piece that was measured: 20 ps late, 3 mm
QUANTILES = (np.arange(200) + 0.5) / 200
DAY = datetime.datetime(2026, 1, 31, 12, tzinfo=datetime.UTC)


def late_echo(receiver: SyntheticReceiver, stage_ps: float, interval_ps: float = INTERVAL_PS) -> np.ndarray:
    """An echo of `ECHO_MV` of which the light is late by a gamma distribution."""
    after = receiver.times_ps - receiver.reference_ps - interval_ps
    late = gamma.ppf(QUANTILES, 2.0, scale=max(stage_ps, 1e-9))
    echo = np.mean([receiver.pulse(after - one, ECHO_MV) for one in late], axis=0)
    return ECHO_MV * echo / echo.max()


def traces(receiver: SyntheticReceiver, echo_mv: np.ndarray, seed: int, records: int = RECORDS) -> np.ndarray:
    clean = receiver.pulse(receiver.times_ps - receiver.reference_ps, receiver.reference_mv) + echo_mv
    slope = np.gradient(clean, receiver.times_ps)
    sd = np.sqrt(receiver.variance(clean, slope) / SWEEPS)
    return clean + sd * np.random.default_rng(seed).standard_normal((records, clean.size))


def ranged(receiver: SyntheticReceiver, calibration: Calibration, values: np.ndarray) -> Ranges:
    return estimate(values, receiver.times_ps, calibration=calibration, sweeps=SWEEPS)


@pytest.fixture(scope="module")
def learnt(receiver: SyntheticReceiver, calibrated: Calibration) -> Calibration:
    """The calibration with a material that was measured on 600 echoes, in the way of `bench penetration`."""
    halves = []
    for seed, stage_ps in ((1, 0.0), (2, PIECE_PS)):
        values = traces(receiver, late_echo(receiver, stage_ps), seed, 600)
        found = ranged(receiver, calibrated, values)
        halves.append((found, left_of_echoes(values, receiver.times_ps, found, calibrated, SWEEPS)))
    (plain, of_plain), (late, of_late) = halves
    found = learn_stretch([(of_plain, of_late)])
    assert found is not None
    bias_mm = float(late.range_mm.mean() - plain.range_mm.mean())
    entry = Material(
        bias_mm=bias_mm, sample_sd_mm=0.05, transfer_sd_mm=0.3, measured=DAY, method="test", stretch=found[0]
    )
    materials = {"bone": {"template": entry, "window": entry}}
    return calibrated.model_copy(update={"materials": materials, "range_zero_sd_mm": 0.1})


def of(learnt: Calibration) -> tuple[Calibration, float]:
    return learnt.for_material("bone", "template"), learnt.materials["bone"]["template"].bias_mm


@pytest.mark.parametrize("stage_ps", [0.0, 5.0, 8.0, 10.0, 12.0])
def test_the_stretch_tells_the_bias_of_late_light(
    receiver: SyntheticReceiver, calibrated: Calibration, learnt: Calibration, stage_ps: float
) -> None:
    """Within twice the deviation that is stated of the power law: 0.05 of the logarithm of the stretch."""
    bone, bias_mm = of(learnt)
    values = traces(receiver, late_echo(receiver, stage_ps), 10 + int(stage_ps))
    found = ranged(receiver, bone, values)
    seen = float(np.nanmean(found.stretch))
    noise = np.sqrt(np.nanmean(found.stretch_variance) / RECORDS)
    if stage_ps == 0.0:
        assert abs(seen) < 4 * noise + 0.02
        return
    plain = ranged(receiver, calibrated, traces(receiver, late_echo(receiver, 0.0), 9))
    true = (found.range_mm.mean() + bias_mm - plain.range_mm.mean()) / bias_mm
    assert true == pytest.approx(stage_ps / PIECE_PS, rel=0.1)  # later light, farther
    assert seen**0.45 == pytest.approx(true, rel=2 * 0.05 * abs(np.log(seen)) + 0.03)


def test_the_variance_of_a_stretch_is_what_repeated_readings_have(
    receiver: SyntheticReceiver, learnt: Calibration
) -> None:
    bone, _ = of(learnt)
    found = ranged(receiver, bone, traces(receiver, late_echo(receiver, PIECE_PS), 20, 600))
    assert np.isfinite(found.stretch).mean() > 0.97
    assert np.nanmean(found.stretch) == pytest.approx(1.0, abs=0.03)
    ratio = np.nanvar(found.stretch) / np.nanmean(found.stretch_variance)
    assert ratio == pytest.approx(1.0, abs=4 * np.sqrt(2 / 600))


def test_windows_tell_the_same_less_surely(receiver: SyntheticReceiver, learnt: Calibration) -> None:
    bone, values = of(learnt)[0], traces(receiver, late_echo(receiver, PIECE_PS), 30)
    at = [receiver.reference_ps + receiver.half_ps(ECHO_MV) + extra for extra in (0.0, INTERVAL_PS)]
    cut = [round((place - 250.0 - receiver.times_ps[0]) / 6.7) for place in at]
    windows = [
        WindowTraces.of(values[:, k : k + 80], [receiver.times_ps[k]] * RECORDS, 6.7, [SWEEPS] * RECORDS) for k in cut
    ]
    found, whole = estimate_windows(*windows, calibration=bone), ranged(receiver, bone, values)
    assert np.nanmean(found.stretch_variance) > np.nanmean(whole.stretch_variance)
    ratio = np.nanvar(found.stretch) / np.nanmean(found.stretch_variance)
    assert ratio == pytest.approx(1.0, abs=4 * np.sqrt(2 / RECORDS))
    assert np.nanmean(found.stretch) == pytest.approx(np.nanmean(whole.stretch), abs=0.08)


def test_late_light_is_neither_another_shape_nor_a_second_surface(
    receiver: SyntheticReceiver, calibrated: Calibration, learnt: Calibration
) -> None:
    values = traces(receiver, late_echo(receiver, 1.1 * PIECE_PS), 40)
    plain, found = ranged(receiver, calibrated, values), ranged(receiver, of(learnt)[0], values)
    noticed = np.uint16(Flag.DISTORTED | Flag.MIXED)
    assert np.mean((plain.flags & noticed) != 0) > 0.9
    assert np.mean((found.flags & noticed) != 0) <= 0.02
    assert found.variance_mm2.mean() < plain.variance_mm2.mean()
    assert found.range_mm.var() / found.variance_mm2.mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / RECORDS))


def test_two_surfaces_in_a_spot_are_still_seen_among_late_echoes(
    receiver: SyntheticReceiver, learnt: Calibration
) -> None:
    """Every twentieth record has two halves, 6 mm apart, which broaden it like more late light.

    Of 15 such records at least half are seen; not one in ten is, where each is rid of its own stretch.
    """
    values = traces(receiver, late_echo(receiver, PIECE_PS), 50)
    both = [late_echo(receiver, PIECE_PS, INTERVAL_PS + extra) for extra in (0.0, 40.0)]
    two = np.arange(RECORDS) % 20 == 10
    values[two] = traces(receiver, np.mean(both, axis=0), 51, int(two.sum()))
    found = ranged(receiver, of(learnt)[0], values)
    mixed = (found.flags & np.uint16(Flag.MIXED)) != 0
    assert mixed[two].mean() > 0.5
    assert mixed[~two].mean() < 0.03
    assert np.isnan(found.stretch[mixed]).all()


def test_without_a_stretch_in_the_calibration_nothing_changes(
    receiver: SyntheticReceiver, calibrated: Calibration, learnt: Calibration
) -> None:
    entry = learnt.materials["bone"]["template"].model_copy(update={"stretch": None})
    plain = learnt.model_copy(update={"materials": {"bone": {"template": entry}}})
    values = traces(receiver, late_echo(receiver, PIECE_PS), 60, 50)
    one, other = ranged(receiver, calibrated, values), ranged(receiver, plain.for_material("bone", "template"), values)
    np.testing.assert_allclose(other.range_mm, one.range_mm - entry.bias_mm, atol=1e-9)
    for name in ("variance_mm2", "response_mv", "flags", "echo_ps"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()
    assert np.isnan(one.stretch).all()
    assert np.isnan(other.stretch).all()


def test_a_pattern_is_not_learnt_from_noise(receiver: SyntheticReceiver, calibrated: Calibration) -> None:
    halves = []
    for seed in (70, 71):
        values = traces(receiver, late_echo(receiver, 0.0), seed)
        found = ranged(receiver, calibrated, values)
        halves.append(left_of_echoes(values, receiver.times_ps, found, calibrated, SWEEPS))
    assert learn_stretch([(halves[0], halves[1])]) is None


def test_a_file_without_a_stretch_keeps_its_digest(learnt: Calibration) -> None:
    known = learnt.content()["materials"]
    assert isinstance(known, dict)
    assert Calibration.model_validate(learnt.content()) == learnt
    entry = learnt.materials["bone"]["template"].model_copy(update={"stretch": None})
    assert "stretch" in known["bone"]["template"]
    assert "stretch" not in entry.model_dump(mode="json")
    assert isinstance(learnt.materials["bone"]["window"].stretch, Stretch)
