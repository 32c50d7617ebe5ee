"""Interlocks as data: bands, hysteresis, hold-off, which of them is raised, and what `why` says."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.interfaces import PulserStatus, SamplerStatus, TemperatureStatus
from picoradar.instrument.controller.exposure import exposure_of, refuse_above_class_1
from picoradar.instrument.controller.interlock_monitor import InterlockMonitor
from picoradar.instrument.controller.interlocks import Interlock, Readings, interlocks
from picoradar.instrument.errors import InterlockTripped
from picoradar.instrument.settings import Settings, override


def diode(degc: float, **changes: Any) -> Readings:
    sound = {"temperature_degc": degc, "target_degc": 23.0, "regulating": True, "stable": True}
    return Readings(diode=TemperatureStatus(**{**sound, **changes}))


def sampler(**changes: Any) -> Readings:
    sound = {
        "state": "idle", "gate": "on", "interlock_closed": True, "trigger_present": True, "trigger_hz": 80_000.0,
        "watchdog_left_s": 0.9,
    }  # fmt: skip
    return Readings(sampler=SamplerStatus(**{**sound, **changes}))


def pulser(**changes: Any) -> Readings:
    sound = {
        "triggers_on": True, "output_on": True, "interlock_closed": True, "prf_hz": 80_000.0, "drive_v": 290.0,
        "measured_v": 290.0, "measured_a": 0.0124,
    }  # fmt: skip
    return Readings(pulser=PulserStatus(**{**sound, **changes}))


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


@pytest.fixture
def monitor(clock: VirtualClock) -> InterlockMonitor:
    settings = Settings()
    return InterlockMonitor(interlocks(settings, exposure_of(settings.pulser)), clock)


@pytest.mark.parametrize(
    ("readings", "name", "action"),
    [
        (sampler(interlock_closed=False), "interlock line", "abort"),
        (sampler(clock_locked=False), "bridge clock", "abort"),
        (sampler(watchdog_left_s=0.3), "host heartbeat", "abort"),
        (sampler(gate="locked"), "gate", "abort"),
        (sampler(trigger_hz=80_900.0), "trigger rate", "abort"),
        (sampler(trigger_hz=300_000.0), "mean power", "off"),
        (pulser(interlock_closed=False), "supply enable", "abort"),
        (pulser(measured_v=286.0), "drive voltage", "abort"),
        (pulser(measured_a=0.021), "average current", "off"),
        (pulser(measured_v=304.0), "pulser heat", "off"),
        (diode(23.0, regulating=False), "diode regulation", "off"),
        (diode(23.0, problem="error 105"), "diode regulation", "off"),
        (diode(24.1), "diode limits", "off"),
        (diode(float("nan")), "diode limits", "off"),
        (Readings(mirrors_answer=False), "mirrors", "abort"),
        (Readings(reference_mv=0.0), "reference pulse", "abort"),
        (Readings(reference_mv=111.0), "reference pulse", "abort"),
        (Readings(reference_share=0.6), "laser output", "abort"),
        (Readings(reference_ps=10_600.0), "reference place", "abort"),
        (Readings(disk_lines=1.5), "disk space", "suspend"),
    ],
)
def test_each_interlock_trips_with_its_action(
    monitor: InterlockMonitor, readings: Readings, name: str, action: str
) -> None:
    with pytest.raises(InterlockTripped) as tripped:
        monitor.judge(readings, emitting=True)
    assert (tripped.value.interlock, tripped.value.action) == (name, action)
    assert any(line.startswith(name) for line in monitor.why())


def test_sound_readings_trip_nothing(monitor: InterlockMonitor) -> None:
    for readings in (sampler(), pulser(), diode(23.0), Readings(None, None, None, True, 45.0, 1.0, 7400.0, 1e6)):
        monitor.judge(readings, emitting=True)
    assert monitor.why() == []


def test_without_light_only_what_matters_then_is_asked_for(monitor: InterlockMonitor) -> None:
    monitor.judge(sampler(gate="off", trigger_hz=0.0, watchdog_left_s=0.0), emitting=False)
    monitor.judge(pulser(measured_v=0.0, triggers_on=False), emitting=False)
    with pytest.raises(InterlockTripped, match="interlock line"):
        monitor.judge(sampler(gate="off", interlock_closed=False), emitting=False)


def test_the_scan_waits_for_the_diode_after_a_hold_off_and_goes_on_inside_the_hysteresis(
    monitor: InterlockMonitor, clock: VirtualClock
) -> None:
    monitor.judge(diode(23.25), emitting=True)  # outside, but not for long enough yet
    assert monitor.why() == []
    clock.sleep(0.6)
    with pytest.raises(InterlockTripped) as held:
        monitor.judge(diode(23.25), emitting=True)
    assert held.value.action == "suspend"
    with pytest.raises(InterlockTripped):
        monitor.judge(diode(23.18), emitting=False)  # inside the band, not yet inside the hysteresis
    monitor.judge(diode(23.14), emitting=False)
    assert monitor.why() == []


def test_readings_that_say_nothing_about_a_tripped_interlock_do_not_raise_it_again(
    monitor: InterlockMonitor, clock: VirtualClock
) -> None:
    monitor.judge(diode(23.25), emitting=True)
    clock.sleep(1.0)
    with pytest.raises(InterlockTripped):
        monitor.judge(diode(23.25), emitting=True)
    monitor.judge(sampler(), emitting=True)
    assert monitor.why() == ["diode temperature: 23.25 degC is outside 22.8 to 23.2 degC; the scan waits for the diode"]


@given(values=st.lists(st.tuples(st.floats(-2, 2), st.floats(0, 3)), max_size=30))
def test_hysteresis_and_hold_off_follow_their_definition(values: list[tuple[float, float]]) -> None:
    clock = VirtualClock()
    lock = Interlock("x", "", lambda r: r.reference_mv, -1, 1, "suspend", "", hysteresis=0.25, hold_off_s=2.0)
    monitor = InterlockMonitor((lock,), clock)
    tripped, since = False, None
    for value, wait_s in values:
        clock.sleep(wait_s)
        inside = abs(value) <= (0.75 if tripped else 1.0)
        since = None if inside else (clock.now() if since is None else since)
        tripped = not inside and (tripped or (since is not None and clock.now() - since >= 2.0))
        try:
            monitor.judge(Readings(reference_mv=value), emitting=True)
            raised = False
        except InterlockTripped:
            raised = True
        assert raised is tripped
        assert bool(monitor.why()) is tripped


def test_the_gravest_of_several_is_raised(monitor: InterlockMonitor, clock: VirtualClock) -> None:
    with pytest.raises(InterlockTripped) as tripped:
        monitor.judge(
            Readings(diode=diode(24.5).diode, sampler=sampler(gate="off").sampler, disk_lines=0.0), emitting=True
        )
    assert tripped.value.action == "off"


# Laser class


def pulser_settings(**changes: Any) -> Any:
    return override(Settings(), {"pulser": changes}).pulser


def test_the_measured_point_bounds_the_energy_with_its_margin() -> None:
    assert exposure_of(pulser_settings()).pulse_energy_nj == pytest.approx(0.300e6 / 80_000 * 1.2)
    # Below a measured voltage the energy of the measurement stands as the bound; between two, that of the higher one.
    assert exposure_of(pulser_settings(drive_v=250.0)).pulse_energy_nj == pytest.approx(4.5)
    assert exposure_of(pulser_settings(drive_v=300.0, prf_hz=20_000.0)).pulse_energy_nj == pytest.approx(5.15 * 1.2)


def test_class_1_is_kept_by_the_radar_as_measured_and_refused_above() -> None:
    exposure = refuse_above_class_1(pulser_settings())
    assert exposure.share(80_000.0) == pytest.approx(4.5 / (0.997848e6 / 80_000), rel=1e-4)
    assert exposure.share(0.0) == 0.0
    bright = pulser_settings(measured_output=((290.0, 80_000.0, 0.9),))
    with pytest.raises(InterlockTripped, match=r"laser class.*13.5 nJ.*12.5 nJ.*not a certification"):
        refuse_above_class_1(bright)


def test_a_voltage_above_all_measurements_is_refused_because_nothing_is_known_there() -> None:
    with pytest.raises(InterlockTripped, match="never measured at 300 V or above"):
        exposure_of(pulser_settings(drive_v=300.0, measured_output=((290.0, 80_000.0, 0.3),)))
