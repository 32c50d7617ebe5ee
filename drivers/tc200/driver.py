"""Thorlabs TC200 heater controller (protocol sheet ``thorlabs_tc200``).

It only heats, so it cannot hold a laser diode at 23 degC in a warm room; where heating is enough it serves in place of
the bench's own controller.
"""

from __future__ import annotations

from picoradar.drivers.errors import DeviceFault, ProtocolError, check_range
from picoradar.drivers.interfaces import Identity, TemperatureStatus
from picoradar.drivers.links import SerialLink, read_number
from picoradar.drivers.tc200.session import Tc200Session
from picoradar.drivers.tc200.wire import (
    Mode,
    Sensor,
    Status,
    encode,
    read_gains,
    read_status,
    read_temperature,
    refusal_in,
)

MIN_DEGC, MAX_DEGC = 20.0, 205.0


class TC200(Tc200Session):
    """One heater controller; satisfies `picoradar.drivers.interfaces.TemperatureController`.

    Parameters
    ----------
    link : SerialLink
        The line to it; owned by this object from now on.
    stable_within_degc : float
        The device has no criterion of stability: within this distance of its target it counts as stable.
    """

    def __init__(self, link: SerialLink, *, stable_within_degc: float = 0.2) -> None:
        super().__init__(link)
        self.stable_within_degc = stable_within_degc

    @property
    def temperature_degc(self) -> float:
        """Measure the temperature in degC."""
        return self._read("tact?", read_temperature, "a temperature")

    @property
    def target_degc(self) -> float:
        """Control the target in degC (float from 20 to the largest temperature)."""
        return self._read("tset?", read_temperature, "a temperature")

    @target_degc.setter
    def target_degc(self, value: float) -> None:
        check_range(self.device, "target", value, MIN_DEGC, self.largest_degc, "degC")
        self.command(f"tset={value:.1f}")

    @property
    def largest_degc(self) -> float:
        """Control the largest temperature in degC (float from 20 to 205)."""
        return self._read("tmax?", read_temperature, "a temperature")

    @largest_degc.setter
    def largest_degc(self, value: float) -> None:
        check_range(self.device, "largest temperature", value, MIN_DEGC, MAX_DEGC, "degC")
        self.command(f"tmax={value:.1f}")

    @property
    def gains(self) -> tuple[int, int, int]:
        """Control the gains P, I and D (int from 1 to 250; I and D from 0)."""
        return self._read("pid?", read_gains, "three gains")

    @gains.setter
    def gains(self, gains: tuple[int, int, int]) -> None:
        for name, value, minimum in zip(("pgain", "igain", "dgain"), gains, (1, 0, 0), strict=True):
            check_range(self.device, name, value, minimum, 250)
        for name, value in zip(("pgain", "igain", "dgain"), gains, strict=True):
            self.command(f"{name}={value:d}")

    @property
    def largest_power_w(self) -> float:
        """Control the largest heating power in W (float from 0.1 to 18)."""
        return self._read("pmax?", read_number, "a number")

    @largest_power_w.setter
    def largest_power_w(self, value: float) -> None:
        check_range(self.device, "largest power", value, 0.1, 18.0, "W")
        self.command(f"pmax={value:.1f}")

    @property
    def beta(self) -> int:
        """Control the beta of a thermistor (int from 2000 to 6000)."""
        return int(self._read("beta?", read_number, "a number"))

    @beta.setter
    def beta(self, value: int) -> None:
        check_range(self.device, "beta", value, 2000, 6000)
        self.command(f"beta={value:d}")

    @property
    def mode(self) -> Mode:
        """Control the mode (`Mode`)."""
        return Mode.CYCLE if Status.CYCLE in self.status_bits else Mode.NORMAL

    @mode.setter
    def mode(self, mode: Mode) -> None:
        answer = self.query(f"mode={mode.name.lower()}")
        # The device answers this one with a range error although it carries it out.
        if mode is Mode.CYCLE or refusal_in(answer) != "CMD_ARG_RANGE_ERR":
            self._check(f"mode={mode.name.lower()}", answer)

    @property
    def status_bits(self) -> Status:
        """Get the status byte (`Status`)."""
        return self._read("stat?", read_status, "a status byte")

    def select_sensor(self, sensor: Sensor) -> None:
        """Choose the temperature sensor."""
        self.command(f"sns={sensor.value}")

    def open(self) -> None:
        """Open the line, make sure that a TC200 answers, set its unit to degC and switch the heater off.

        Raises
        ------
        LinkLost, Timeout
            When the line or the device is not there.
        ProtocolError
            When another device answers.
        DeviceFault
            When the heater cannot be verified off.
        """
        self._open_line(encode(""))
        self.identify()
        self.command("unit=c")
        if not self.status_bits.celsius:
            raise DeviceFault(self.device, "unit is not degC after it was set to degC")
        self.found_on = ("diode",) if Status.ENABLED in self.status_bits else ()
        self.off()

    def identify(self) -> Identity:
        """Get model and firmware.

        Raises
        ------
        ProtocolError
            When the answer does not name a TC200.
        """
        text = self.query("*idn?")
        if "TC200" not in text.upper():
            what = f"another device answers: {text!r}"
            raise ProtocolError(self.device, what, "check which port is which in the settings")
        return Identity(model="TC200", firmware=text)

    def regulate(self, target_degc: float) -> None:
        """Set the target (degC, 20 to the largest temperature) and switch the heater on; both read back.

        Raises
        ------
        LimitError
            When the target is out of range; nothing was sent.
        DeviceFault
            When the target or the heater reads back differently.
        """
        self.target_degc = target_degc
        self._switch(on=True)
        if abs((found := self.target_degc) - target_degc) > 0.05:
            raise DeviceFault(self.device, f"target is {found:g} degC after it was set to {target_degc:g} degC")

    def off(self) -> None:
        """Switch the heater off; read back."""
        self._switch(on=False)

    def status(self) -> TemperatureStatus:
        """Measure the present state."""
        regulating = Status.ENABLED in self.status_bits
        temperature, target = self.temperature_degc, self.target_degc
        near = abs(temperature - target) <= self.stable_within_degc
        return TemperatureStatus(temperature, target, regulating, stable=regulating and near)

    def _switch(self, *, on: bool) -> None:
        if (Status.ENABLED in self.status_bits) is not on:
            self.command("ens")  # toggles, so the status is read before it is sent again
        if (Status.ENABLED in self.status_bits) is not on:
            what = f"heater is {'off' if on else 'on'} after it was switched {'on' if on else 'off'}"
            raise DeviceFault(self.device, what, "check the sensor, or switch the heater off by hand")

    def _make_safe(self) -> None:
        self.off()
