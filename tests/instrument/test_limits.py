"""Each safety limit holds wherever it is looked at."""

from __future__ import annotations

import pytest

from picoradar.drivers.bridge.driver import WATCHDOG_MS
from picoradar.instrument.controller.exposure import exposure_of
from picoradar.instrument.controller.interlocks import interlocks
from picoradar.instrument.controller.supervision import BEAT_S
from picoradar.instrument.errors import BadInput
from picoradar.instrument.ranging import PlanSettings
from picoradar.instrument.settings import MIN_DISTANCE, TRANSMITTER_HEAT, WATCHDOG, Settings, max_drive_v, override

MEASURED = [[330.0, 20_000.0, 0.103]]


@pytest.mark.parametrize(("prf_hz", "most_v"), [(80_000.0, 300.0), (85_600.0, 290.02), (70_000.0, 320.71)])
def test_the_heat_of_the_transmitter_is_limited_alike_in_settings_and_interlock(prf_hz: float, most_v: float) -> None:
    assert max_drive_v(prf_hz) == pytest.approx(most_v, abs=0.01)
    override(Settings(), {"pulser": {"prf_hz": prf_hz, "drive_v": most_v - 0.02, "measured_output": MEASURED}})
    with pytest.raises(BadInput, match=f"overheats the transmitter at {prf_hz:g} Hz; at most {most_v:.0f} V"):
        override(Settings(), {"pulser": {"prf_hz": prf_hz, "drive_v": most_v + 0.02, "measured_output": MEASURED}})
    assert (most_v + 0.02) ** 2 * prf_hz > TRANSMITTER_HEAT.value > (most_v - 0.02) ** 2 * prf_hz


def test_the_interlock_of_heat_is_a_share_of_the_same_limit() -> None:
    from picoradar.drivers.interfaces import PulserStatus
    from picoradar.instrument.controller.interlocks import Readings

    (heat,) = [i for i in interlocks(Settings(), exposure_of(Settings().pulser)) if i.name == "pulser heat"]
    at = PulserStatus(True, True, True, prf_hz=80_000.0, drive_v=300.0, measured_v=300.0, measured_a=0.01)
    assert heat.quantity(Readings(pulser=at)) == pytest.approx(1.0)
    assert heat.maximum == 1.02


def test_the_heartbeat_comes_every_quarter_of_the_time_that_the_driver_sets() -> None:
    assert WATCHDOG_MS == 1000
    assert WATCHDOG.value == WATCHDOG_MS / 1000
    assert WATCHDOG.value / 4 == BEAT_S


def test_no_raster_and_no_window_lies_nearer_than_the_overlap_of_the_pulses() -> None:
    assert MIN_DISTANCE.value == PlanSettings().nearest_mm == 620.0
    override(Settings(), {"scan": {"distance_mm": 620.0}})
    with pytest.raises(BadInput, match="620"):
        override(Settings(), {"scan": {"distance_mm": 619.9}})


@pytest.mark.parametrize("table", [{"prf_hz": 19_999.0}, {"prf_hz": 240_001.0}, {"drive_v": 239.9}, {"drive_v": 330.1}])
def test_the_pulser_is_asked_for_nothing_that_its_driver_refuses(table: dict[str, float]) -> None:
    with pytest.raises(BadInput):
        override(Settings(), {"pulser": table})
