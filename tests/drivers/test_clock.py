"""Clocks: order of timers, waiting, nesting, and that real clocks keep the same promises."""

from __future__ import annotations

import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.drivers.clock import Clock, ScaledClock, VirtualClock


@pytest.mark.parametrize("make", [VirtualClock, ScaledClock, lambda: ScaledClock(10.0)])
def test_satisfies_the_protocol(make):
    assert isinstance(make(), Clock)


def test_virtual_time_jumps_without_the_wall():
    clock = VirtualClock()
    start = time.monotonic()
    clock.sleep(3600)
    assert clock.now() == 3600
    assert time.monotonic() - start < 1


@settings(deadline=None)
@given(st.lists(st.integers(0, 20), max_size=30))
def test_timers_run_in_order_of_time_then_of_setting(moments):
    clock = VirtualClock()
    ran = []
    for i, moment in enumerate(moments):
        clock.call_at(moment, lambda i=i: ran.append((clock.now(), i)))
    clock.sleep(100)
    assert ran == sorted((moment, i) for i, moment in enumerate(moments))


def test_periodic_timer_keeps_its_beat_until_cancelled():
    clock = VirtualClock()
    beats = []
    timer = clock.every(0.25, lambda: beats.append(clock.now()))
    clock.sleep(1.0)
    timer.cancel()
    clock.sleep(1.0)
    assert beats == [0.25, 0.5, 0.75, 1.0]
    assert clock.next_due() is None


def test_missed_beats_are_not_made_up():
    clock = VirtualClock()
    beats = []

    def slow():
        beats.append(clock.now())
        clock.sleep(2.5)

    clock.every(1.0, slow)
    clock.advance_to(7.0)
    assert beats == [1.0, 3.5, 6.0]


def test_timer_may_cancel_itself():
    clock = VirtualClock()
    beats = []

    def once():
        beats.append(clock.now())
        timer.cancel()

    timer = clock.every(1.0, once)
    clock.sleep(5)
    assert beats == [1.0]


def test_wait_ends_when_the_condition_holds():
    clock = VirtualClock()
    done = []
    clock.call_at(2.0, lambda: done.append(True))
    assert clock.wait(lambda: bool(done), 5.0)
    assert clock.now() == 2.0
    assert not clock.wait(lambda: False, 5.0)
    assert clock.now() == 7.0


def test_waiting_for_ever_on_nothing_is_an_error():
    with pytest.raises(RuntimeError, match="nothing that could end it is due"):
        VirtualClock().wait(lambda: False, float("inf"))


def test_time_in_a_callback_never_runs_backwards():
    clock = VirtualClock()
    seen = []

    def nested():
        clock.sleep(1.0)
        seen.append(clock.now())

    clock.call_at(1.0, nested)
    clock.call_at(1.5, lambda: seen.append(clock.now()))
    clock.advance_to(1.2)
    assert seen == [1.5, 2.0]
    assert clock.now() == 2.0


def test_speed_holds_virtual_time_back():
    clock = VirtualClock(speed=100.0)
    start = time.monotonic()
    clock.sleep(5.0)
    assert time.monotonic() - start >= 0.04


@pytest.mark.parametrize("factor", [1.0, 50.0])
def test_real_clocks_run_timers_while_they_sleep_and_wait(factor):
    clock = ScaledClock(factor)
    beats = []
    clock.every(0.01 * factor, lambda: beats.append(clock.now()))
    start = time.monotonic()
    clock.sleep(0.05 * factor)
    assert time.monotonic() - start >= 0.045
    assert 1 <= len(beats) <= 5
    assert clock.wait(lambda: len(beats) > 6, 10.0 * factor)
    assert not clock.wait(lambda: False, 0.01 * factor)


def test_ports_wait_in_the_time_of_the_wall():
    assert ScaledClock(10.0).port_wait_s(0.5) == 0.05
    assert ScaledClock().port_wait_s(0.5) == 0.5


@pytest.mark.parametrize("bad", [0.0, -1.0, float("inf"), float("nan")])
def test_impossible_speeds_and_periods_are_refused(bad):
    with pytest.raises(ValueError, match="must be positive"):
        ScaledClock(bad)
    with pytest.raises(ValueError, match="must be positive"):
        VirtualClock(speed=bad)
    if not bad > 0:
        with pytest.raises(ValueError, match="must be positive"):
            VirtualClock().every(bad, lambda: None)
