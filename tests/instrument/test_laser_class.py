"""Class 1 limits against the check values of the formulas sheet (2.10) and the dissertation (0.998 mW at 904 nm)."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from picoradar.instrument.controller import PulseTrain, classify
from picoradar.instrument.controller.laser_class import c4, c5, mean_power_ael_mw


def test_mean_power_limits_at_known_wavelengths() -> None:
    assert c4(904) == pytest.approx(2.558586, abs=1e-6)
    assert mean_power_ael_mw(904) == pytest.approx(0.997848, abs=1e-6)
    assert mean_power_ael_mw(850) == pytest.approx(0.7782, abs=1e-4)
    assert mean_power_ael_mw(905) == pytest.approx(1.0025, abs=1e-4)
    assert mean_power_ael_mw(940) == pytest.approx(1.1778, abs=1e-4)


@pytest.mark.parametrize(
    ("prf_hz", "factor", "train_nj", "mean_nj", "limit_nj"),
    [
        (100, 0.889, 175.2, 9978, 175.2),
        (1e3, 0.500, 98.5, 997.8, 98.5),
        (1e4, 0.400, 78.8, 99.8, 78.8),
        (2e4, 0.400, 78.8, 49.9, 49.9),
        (1e5, 0.400, 78.8, 9.98, 9.98),
    ],
)
def test_pulse_limits_of_the_table(
    prf_hz: float, factor: float, train_nj: float, mean_nj: float, limit_nj: float
) -> None:
    found = classify(PulseTrain(904, prf_hz, 1.0, 3e-9))
    assert found.single_pulse_ael_nj == pytest.approx(197.01, abs=0.01)
    assert c5(prf_hz * 10) == pytest.approx(factor, abs=5e-4)
    assert found.limits_nj["pulse train"] == pytest.approx(train_nj, rel=1e-3)
    assert found.limits_nj["mean power"] == pytest.approx(mean_nj, rel=1e-3)
    assert found.pulse_limit_nj == pytest.approx(limit_nj, rel=1e-3)


def test_the_radar_of_the_dissertation_is_class_1_and_three_times_its_power_is_not() -> None:
    energy_nj = 0.3e-3 / 80_000 * 1e9
    assert classify(PulseTrain(904, 80_000, energy_nj, 44e-12)).class1
    assert not classify(PulseTrain(904, 80_000, 3.4 * energy_nj, 44e-12)).class1


def test_c5_never_exceeds_one_and_ends_at_four_tenths() -> None:
    assert c5(601) == 1.0
    assert c5(24_414) == pytest.approx(0.4, abs=1e-5)
    assert c5(1e9) == 0.4


@given(energy=st.floats(0, 1e4), prf=st.floats(1, 1e6), more=st.floats(1, 10))
def test_more_light_is_never_safer(energy: float, prf: float, more: float) -> None:
    if not classify(PulseTrain(904, prf, energy, 44e-12)).class1:
        assert not classify(PulseTrain(904, prf, energy * more, 44e-12)).class1


@pytest.mark.parametrize(
    "bad", [(532, 8e4, 1, 44e-12), (904, 0, 1, 44e-12), (904, 8e4, -1, 44e-12), (904, 8e4, 1, 1.0)]
)
def test_outside_its_validity_it_refuses(bad: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="outside"):
        PulseTrain(*bad)
