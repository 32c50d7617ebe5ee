"""The oscilloscope at the laser: light at one of its channels, the current at another if that is wired."""

from __future__ import annotations

import pytest

from picoradar.drivers.errors import DeviceFault, Timeout
from picoradar.instrument.cli.light_meters import DetectorAndPowerMeter
from picoradar.instrument.procedures.station.light import CURRENT_SWEEP


class Channel:
    """One channel of an oscilloscope that only one may have open at a time."""

    users: list[Channel]

    def __init__(self, users: list[Channel], fault: Exception | None = None) -> None:
        self.users, self._fault = users, fault

    def open(self) -> None:
        assert not self.users
        self.users.append(self)

    def close(self) -> None:
        if self in self.users:
            self.users.remove(self)

    def configure(self, _sweep: object) -> None:
        if self._fault is not None:
            raise self._fault

    def take(self, _run_id: int) -> list[str]:
        return ["the record"]


def meters(fault: Exception | None = None) -> tuple[DetectorAndPowerMeter, Channel, list[Channel]]:
    users: list[Channel] = []
    light, current = Channel(users), Channel(users, fault)
    both = DetectorAndPowerMeter(light, current, lambda _where, _wait: 0.3)  # type: ignore[arg-type]
    both.open()
    return both, light, users


def test_the_current_is_taken_at_its_own_channel_and_the_light_comes_back() -> None:
    both, light, users = meters()
    assert both.current(CURRENT_SWEEP) == ("the record", pytest.approx(5.0))  # mV for each A: 0.25 ohm, 50 to 1
    assert users == [light]


def test_a_refused_channel_is_no_current_and_anything_else_is_told() -> None:
    both, light, users = meters(DeviceFault("oscilloscope", "refused CHANnel3", "use another"))
    assert both.current(CURRENT_SWEEP) is None
    assert users == [light]
    both, light, users = meters(Timeout("oscilloscope", "did not answer", "see to the cable"))
    with pytest.raises(Timeout):
        both.current(CURRENT_SWEEP)
    assert users == [light]
