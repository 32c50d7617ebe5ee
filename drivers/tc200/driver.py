"""Thorlabs TC200 heater controller: the example of a device that echoes (protocol sheet ``thorlabs_tc200``).

It only heats, so it cannot hold a laser diode at 23 degC in a warm room; where heating is enough it satisfies
the same interface as the bench's own controller. Answers are matched by their echo.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from picoradar.drivers.errors import DeviceFault, ProtocolError, check_range
from picoradar.drivers.interfaces import Identity, TemperatureStatus
from picoradar.drivers.links import SerialLink, read_number
from picoradar.drivers.links.retry import retry
from picoradar.drivers.tc200.wire import (
    PROMPT,
    Mode,
    Sensor,
    Status,
    encode,
    read_gains,
    read_status,
    read_temperature,
    refusal_in,
    split_answer,
)

BAUD = 115200
LEAST_DEGC, MOST_DEGC = 20.0, 205.0
LONGEST_ANSWER = 512
LATE_S = 0.1
TRIES = 3

T = TypeVar("T")


class TC200:
    """One heater controller; satisfies `picoradar.drivers.interfaces.TemperatureController`.

    Parameters
    ----------
    link : SerialLink
        The line to it; owned by this object from now on.
    stable_within_degc : float
        The device has no measure of stability: it counts as stable this near to its target.
    """

    def __init__(self, link: SerialLink, *, stable_within_degc: float = 0.2) -> None:
        self.link = link
        self.stable_within_degc = stable_within_degc
        self._in_step = True  # False after a failure: late answers may still come

    @property
    def device(self) -> str:
        """Get the device's name for messages."""
        return self.link.device

    @property
    def temperature_degc(self) -> float:
        """Measure the temperature in degC."""
        return self._read("tact?", read_temperature)

    @property
    def target_degc(self) -> float:
        """Control the target in degC (float from 20 to the largest temperature)."""
        return self._read("tset?", read_temperature)

    @target_degc.setter
    def target_degc(self, value: float) -> None:
        check_range(self.device, "target", value, LEAST_DEGC, self.largest_degc, "degC")
        self.command(f"tset={value:.1f}")

    @property
    def largest_degc(self) -> float:
        """Control the largest temperature in degC (float from 20 to 205)."""
        return self._read("tmax?", read_temperature)

    @largest_degc.setter
    def largest_degc(self, value: float) -> None:
        check_range(self.device, "largest temperature", value, LEAST_DEGC, MOST_DEGC, "degC")
        self.command(f"tmax={value:.1f}")

    @property
    def gains(self) -> tuple[int, int, int]:
        """Control the gains P, I and D (int from 1 to 250; I and D from 0)."""
        return self._read("pid?", read_gains)

    @gains.setter
    def gains(self, gains: tuple[int, int, int]) -> None:
        for name, value, least in zip(("pgain", "igain", "dgain"), gains, (1, 0, 0), strict=True):
            check_range(self.device, name, value, least, 250)
        for name, value in zip(("pgain", "igain", "dgain"), gains, strict=True):
            self.command(f"{name}={value:d}")

    @property
    def largest_power_w(self) -> float:
        """Control the largest heating power in W (float from 0.1 to 18)."""
        return self._read("pmax?", read_number)

    @largest_power_w.setter
    def largest_power_w(self, value: float) -> None:
        check_range(self.device, "largest power", value, 0.1, 18.0, "W")
        self.command(f"pmax={value:.1f}")

    @property
    def beta(self) -> int:
        """Control the beta of a thermistor (int from 2000 to 6000)."""
        return int(self._read("beta?", read_number))

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
        # Normal is answered with a range error although it is carried out.
        if mode is Mode.CYCLE or refusal_in(answer) != "CMD_ARG_RANGE_ERR":
            self._refuse(f"mode={mode.name.lower()}", answer)

    @property
    def status_bits(self) -> Status:
        """Get the status byte (`Status`)."""
        return self._read("stat?", read_status)

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
        self.link.open()
        self.link.write(encode(""))
        self.link.drain(quiet_s=LATE_S)
        self._in_step = True
        self.identify()
        self.command("unit=c")
        if not self.status_bits.celsius:
            raise DeviceFault(self.device, "unit is not degC after it was set to it")
        self.off()

    def close(self) -> None:
        """Switch the heater off and close the line; harmless when it is closed or has vanished.

        Raises
        ------
        DeviceError
            When the heater could not be verified off; the line is closed all the same.
        """
        try:
            if self.link.is_open:
                self.off()
        finally:
            self.link.close()

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
        """Set the target (degC, 20 to the largest temperature) and switch the heater on; both read back."""
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

    def command(self, text: str) -> None:
        """Send a command that has no answer of its own."""
        self._refuse(text, self.query(text))

    def query(self, text: str) -> str:
        """Send one command and get its answer, matched by the echo; two retries of what ends with ``?``.

        Raises
        ------
        Timeout, ProtocolError, LinkLost
            When no answer, or none in its form, came.
        """
        return retry(TRIES if text.endswith("?") else 1, lambda: self._exchange(text))

    def _exchange(self, text: str) -> str:
        if not self._in_step:
            self.link.drain(quiet_s=LATE_S)
        self._in_step = False
        self.link.write(encode(text))

        def match(received: bytes) -> str | None:
            try:
                echo, answer = split_answer(received)
            except ValueError as error:
                raise ProtocolError(self.device, f"unreadable answer: {error}", "check the baud rate") from error
            return answer if echo.strip() == text else None

        answer = self.link.read_match(PROMPT, match, limit=LONGEST_ANSWER)
        self._in_step = True
        return answer

    def _switch(self, *, on: bool) -> None:
        if (Status.ENABLED in self.status_bits) is not on:
            self.command("ens")  # toggles, so it is never sent again without a look at the status
        if (Status.ENABLED in self.status_bits) is not on:
            what = f"heater is {'off' if on else 'on'} after it was switched {'on' if on else 'off'}"
            raise DeviceFault(self.device, what, "check the sensor, or switch the heater off by hand")

    def _refuse(self, text: str, answer: str) -> None:
        if (code := refusal_in(answer)) is not None:
            raise DeviceFault(self.device, f"refused {text}: {code}", code=code)

    def _read(self, text: str, convert: Callable[[str], T]) -> T:
        answer = self.query(text)
        self._refuse(text, answer)
        try:
            return convert(answer)
        except ValueError as error:
            self._in_step = False
            raise ProtocolError(self.device, f"answered {answer!r} to {text}: {error}") from error
