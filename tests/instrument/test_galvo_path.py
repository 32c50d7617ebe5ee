"""Paths for the galvo controller: every place has its time before and after its mark."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.instrument.acquisition import Stop, plan_path
from picoradar.instrument.acquisition.galvo_path import LONGEST_PATH, SENT_PER_S, SPARE_S
from picoradar.instrument.errors import BadInput


def test_every_mark_has_its_wait_before_and_its_record_behind() -> None:
    rng = np.random.default_rng(1)
    stops = [Stop(np.array([100 + k, 7]), *rng.uniform(0.0, 2e-3, 2)) for k in range(40)]
    path = plan_path(np.array([50, 7]), 12e-3, stops)
    assert len(path.codes) == len(path.marked)
    marks = np.flatnonzero(path.marked)
    assert len(marks) == 40
    for stop, mark in zip(stops, marks, strict=True):
        there = np.flatnonzero((path.codes == stop.codes).all(axis=1))
        assert np.array_equal(there, np.arange(there[0], there[-1] + 1))
        assert (mark - there[0]) / path.rate_hz >= stop.wait_s
        assert (there[-1] + 1 - mark) / path.rate_hz >= stop.record_s + SPARE_S - 1e-12


def test_the_time_on_the_way_to_the_controller_counts_as_rest() -> None:
    stops = [Stop(np.array([100, 7]), 1e-3, 1e-3)] * 100
    path = plan_path(np.array([50, 7]), 12e-3, stops)
    rest_s = np.count_nonzero(path.codes[:, 0] == 50) / path.rate_hz
    assert rest_s + len(path.codes) / SENT_PER_S >= 12e-3
    assert rest_s < 1e-3
    assert np.count_nonzero(plan_path(np.array([50, 7]), 0.0, stops).codes[:, 0] == 50) == 1


def test_a_long_line_gets_coarser_and_an_endless_one_is_refused() -> None:
    path = plan_path(np.array([0, 0]), 12e-3, [Stop(np.array([k, 0]), 1e-3, 5e-3) for k in range(200)])
    assert path.rate_hz < 10_000
    assert len(path.codes) <= LONGEST_PATH
    with pytest.raises(BadInput, match="scan fewer columns"):
        plan_path(np.array([0, 0]), 12e-3, [Stop(np.array([k, 0]), 1e-3, 50e-3) for k in range(200)])
