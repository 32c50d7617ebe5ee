"""Parameters of the simulated TEC with their defaults, and the flash that keeps them."""

from __future__ import annotations

from collections.abc import Mapping

from picoradar.drivers.clock import Clock, Timer
from picoradar.drivers.mecom import PARAMETERS

FLASH_DELAY_S = 0.5
SAVING = 108

# As the device was set up for this bench. Beyond 1.6 A the Joule heat in its Peltier element outweighs the cooling.
DEFAULTS: dict[int, float] = {
    2021: 4.0,
    2030: 1.6,
    2031: 21.0,
    2032: 5.6,
    2033: 25.0,
    2000: 2,
    2050: 57600,
    3000: 25.0,
    3002: 1.0,
    3003: 0.5,
    3010: 60.0,
    3011: 60.0,
    3013: 0.2,
    4010: -40.0,
    4011: 80.0,
    4012: 100.0,
    4040: 0.1,
    4041: 10.0,
    4034: 3,
    52012: 1,
    52200: 25.0,
}
PIN_DEFAULTS = {6103: 1.0}  # of every pin; 0 for the others


class Memory:
    """Working values, and what survives a reset.

    Changed settings are saved 0.5 s after the last change, unless parameter 108 is 1.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    own : mapping
        Parameters that differ from device to device: type, serial number, address.
    """

    def __init__(self, clock: Clock, own: Mapping[int, float]) -> None:
        self.clock = clock
        self.values = dict.fromkeys(PARAMETERS, 0.0) | DEFAULTS | dict(own)
        self.pins = {
            (row.number, pin): PIN_DEFAULTS.get(row.number, 0.0)
            for row in PARAMETERS.values()
            if row.instances > 1
            for pin in range(1, row.instances + 1)
        }
        self.flash_writes = 0
        self._flash = dict(self.values)
        self._flash_pins = dict(self.pins)
        self._timer: Timer | None = None

    @property
    def flash_state(self) -> int:
        """Get parameter 109: 0 all saved, 1 waiting to be written, 2 saving is off."""
        return 2 if self.values[SAVING] else int(self._timer is not None)

    def set(self, number: int, value: float, pin: int = 1) -> None:
        """Take a new value, and save it soon if saving is on."""
        if (number, pin) in self.pins:
            self.pins[number, pin] = value
        else:
            self.values[number] = value
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if not self.values[SAVING]:
            self._timer = self.clock.call_at(self.clock.now() + FLASH_DELAY_S, self.save)

    def save(self) -> None:
        """Write all settings to the flash; whether the output is on is not a setting, nor are 108 and 52200."""
        self._timer = None
        self.flash_writes += 1
        self._flash = self.values | {SAVING: 0, 2010: 0, 52200: DEFAULTS[52200]}
        self._flash_pins = dict(self.pins)

    def reload(self) -> None:
        """Take all settings from the flash, as after a reset."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self.values.update(self._flash)
        self.pins.update(self._flash_pins)
