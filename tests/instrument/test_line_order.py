"""The order in which the lines of a raster are taken."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from picoradar.instrument.acquisition.order import COARSEST, LineOrder

ROWS = st.integers(1, 200)


def test_an_interlaced_raster_is_coarse_first() -> None:
    order = LineOrder(40, "interlaced")
    assert order.lines[:10] == (0, 16, 32, 8, 24, 4, 12, 20, 28, 36)
    assert order.lines[20:23] == (1, 3, 5)
    assert LineOrder(5).lines == (0, 1, 2, 3, 4)


@given(ROWS, st.integers(1, 200))
def test_every_line_is_taken_once_and_any_beginning_lies_evenly(rows: int, first: int) -> None:
    order = LineOrder(rows, "interlaced")
    assert sorted(order.lines) == list(range(rows))
    some = sorted(order.lines[:first])
    gaps = [b - a for a, b in zip(some, [*some[1:], rows], strict=True)]
    whole_passes = -(-rows // COARSEST)
    if first >= whole_passes:  # the first pass reaches to the other end
        assert max(gaps) <= COARSEST
        halved = sorted(order.lines[: -(-rows // (COARSEST // 2))])
        assert {b - a for a, b in itertools.pairwise(halved)} <= {COARSEST // 2}


@given(ROWS, st.sampled_from(["rows", "interlaced"]))
def test_neighbours_of_a_line_are_known_before_it_and_the_order_walks_both_ways(rows: int, name: str) -> None:
    order = LineOrder(rows, name)  # type: ignore[arg-type]
    line = order.next_after(-1)
    before = -1
    taken: list[int] = []
    while line is not None:
        assert order.last_before(line) == before
        assert set(order.beside(line)) == {near for near in (line - 1, line + 1) if near in taken}
        assert list(order.before(line, 3)) == taken[-3:]
        taken.append(line)
        before, line = line, order.next_after(line)
    assert tuple(taken) == order.lines


@pytest.mark.parametrize("name", ["rows", "interlaced"])
def test_some_lines_are_sorted_as_they_are_taken(name: str) -> None:
    order = LineOrder(33, name)  # type: ignore[arg-type]
    assert order.sorted([31, 8, 16, 32]) == [line for line in order.lines if line in (31, 8, 16, 32)]
