"""Meerstetter TEC-1091 / 1089: keeps the laser diode at its temperature (protocol sheet ``mecom_tec``).

Before set points are written, saving to flash is switched off (parameter 108), because the flash wears.
The device's own watchdog (2060) switches the output off when the host is gone.
"""

from __future__ import annotations

from picoradar.drivers.errors import DeviceFault, ProtocolError, Timeout, check_range
from picoradar.drivers.interfaces import Identity, TemperatureStatus
from picoradar.drivers.links import Control, Reading, SerialLink, SerialSession
from picoradar.drivers.mecom.parameters import PARAMETERS, DeviceStatus, OutputEnable, OutputStageInput, Stability
from picoradar.drivers.mecom.session import MeCom
from picoradar.drivers.mecom.wire import ERRORS

MODELS = {1089: "TEC-1089", 1091: "TEC-1091"}
START_UP_S = 5.0
WATCHDOG_EXPIRED = 183


def _control(number: int, doc: str, unit: str) -> Control[int, float]:
    row = PARAMETERS[number]
    return Control(number, float, doc, limits=(row.minimum, row.maximum), unit=unit)


class Tec(SerialSession):
    """One channel of a temperature controller; satisfies `picoradar.drivers.interfaces.TemperatureController`.

    Parameters
    ----------
    link : SerialLink
        The line to it (57600 baud as shipped); owned by this object from now on.
    address : int
        Address on the line, 1 to 254.
    instance : int
        Channel, 1 or 2.
    watchdog_s : float
        Time without a message of the host (s) after which the device stops its output, 0.1 to 600; 0 for never.
    first_sequence : int
        Number of the first telegram, 0 to 65535.
    """

    def __init__(
        self, link: SerialLink, address: int = 1, *, instance: int = 1, watchdog_s: float = 0.0, first_sequence: int = 0
    ) -> None:
        super().__init__(link)
        self.session = MeCom(link, address, first_sequence=first_sequence)
        self.instance = instance
        self.watchdog_s = watchdog_s

    target_degc = _control(3000, "Control the target temperature in degC (float from -273.15 to 1000).", "degC")
    ramp_degc_per_s = _control(3003, "Control the ramp of the target in degC/s (float from 0 to 1000).", "degC/s")
    proximity_degc = _control(3002, "Control how far from the target the ramp slows down, in degC (float).", "degC")
    kp = _control(3010, "Control the gain of the controller in %/degC (float from 0).", "%/degC")
    ti_s = _control(3011, "Control the integration time in s (float from 0).", "s")
    td_s = _control(3012, "Control the differentiation time in s (float from 0).", "s")
    current_limit_a = _control(2030, "Control the largest output current in A (float from 0 to 4).", "A")
    voltage_limit_v = _control(2031, "Control the largest output voltage in V (float from 0 to 21).", "V")
    lower_threshold_degc = _control(4010, "Control the lower error threshold in degC (float).", "degC")
    upper_threshold_degc = _control(4011, "Control the upper error threshold in degC (float).", "degC")
    stable_deviation_degc = _control(4040, "Control the band that counts as stable in degC (float).", "degC")
    stable_min_s = _control(4041, "Control how long it must stay in the band in s (float).", "s")
    stable_max_s = _control(4042, "Control within what time it must be stable in s (float; 0: any).", "s")
    largest_change_degc_per_s = _control(
        4012, "Control the largest change before an error in degC/s (float).", "degC/s"
    )
    static_current_a = _control(2020, "Control the current of the static mode in A (float from -4 to 4).", "A")
    static_voltage_v = _control(2021, "Control the voltage of the static mode in V (float from -21 to 21).", "V")
    current_threshold_a = _control(2032, "Control the current that raises an error in A (float from 0 to 5.6).", "A")
    voltage_threshold_v = _control(2033, "Control the voltage that raises an error in V (float from 0 to 25).", "V")
    reply_delay_us = Control(2052, int, "Control the delay of answers in us (int from 0 to 1e6).", limits=(0, 1e6))
    host_watchdog_s = _control(2060, "Control after how long without the host it stops, in s (float; 0: never).", "s")
    live_enable = Control(50000, bool, "Control the output in mode `OutputEnable.LIVE` (bool).", limits=(0, 1))
    output_stage_input = Control(2000, OutputStageInput, "Control what drives the output (`OutputStageInput`).")
    output_enable = Control(2010, OutputEnable, "Control the output (`OutputEnable`).")
    flash_saving_off = Control(108, bool, "Control whether settings stay out of the flash (bool).", limits=(0, 1))
    temperature_degc = Reading(1000, float, "Measure the object temperature in degC.")
    sink_degc = Reading(1001, float, "Measure the sink temperature in degC.")
    nominal_degc = Reading(1011, float, "Get the present target of the ramp in degC.")
    output_a = Reading(1020, float, "Measure the output current in A.")
    output_v = Reading(1021, float, "Measure the output voltage in V.")
    stability = Reading(1200, Stability, "Get whether it regulates and is stable (`Stability`).")
    device_status = Reading(104, DeviceStatus, "Get the device status (`DeviceStatus`).")
    error_number = Reading(105, int, "Get the number of the present error (0: none).")

    def open(self) -> None:
        """Open the line, make sure that a TEC answers, switch its output off and arm its watchdog.

        A latched error of its watchdog is reset: an earlier host has gone, and the watchdog has done its work. `status`
        reports every other latched error, and `reset` clears it.

        Raises
        ------
        LinkLost, Timeout
            When the line or the device is not there.
        ProtocolError
            When another device answers.
        DeviceFault
            When a setting is refused or the output cannot be verified off.
        """
        self.link.open()
        self.identify()
        if self.error_number == WATCHDOG_EXPIRED:
            self.reset()
        self.found_on = () if self.output_enable is OutputEnable.OFF else ("diode",)
        self._set_up()
        self.off()

    def identify(self) -> Identity:
        """Get model, serial number and firmware.

        Raises
        ------
        ProtocolError
            When the device type is none of this family.
        """
        kind = int(self.get_number(100))
        if kind not in MODELS:
            what = f"another device answers: type {kind}"
            raise ProtocolError(self.device, what, "check which port is which in the settings")
        serial, firmware = int(self.get_number(102)), int(self.get_number(103))
        return Identity(model=MODELS[kind], serial_number=str(serial), firmware=f"{firmware / 100:.2f}")

    def regulate(self, target_degc: float) -> None:
        """Set the target (degC) and switch the output on; both read back.

        Raises
        ------
        LimitError
            When the target is out of range; nothing was sent.
        DeviceFault
            When the device is in error, refuses, or reads back something else.
        """
        row = PARAMETERS[3000]
        check_range(self.device, "target", target_degc, row.minimum, row.maximum, "degC")
        self._refuse_problem()
        self._set_up()  # again: it may have lost its supply since it was opened
        self.target_degc = target_degc
        self.output_stage_input = OutputStageInput.TEMPERATURE_CONTROLLER
        self._switch(OutputEnable.ON)
        if abs((found := self.target_degc) - target_degc) > 1e-3:
            raise DeviceFault(self.device, f"target is {found:g} degC after it was set to {target_degc:g} degC")
        self._refuse_problem()

    def off(self) -> None:
        """Switch the output off; read back."""
        self._switch(OutputEnable.OFF)

    def status(self) -> TemperatureStatus:
        """Measure the present state."""
        stability = self.stability
        return TemperatureStatus(
            temperature_degc=self.temperature_degc,
            target_degc=self.target_degc,
            regulating=stability is not Stability.NOT_REGULATING,
            stable=stability is Stability.STABLE,
            problem=self._problem(),
        )

    def emergency_stop(self) -> None:
        """Switch all outputs off at once (``ES``); leaves error 11 until `reset`."""
        self.session.request("ES")

    def save(self) -> None:
        """Save all settings to flash now (``SP``; firmware 6 and later)."""
        self.session.request("SP")

    def reset(self) -> None:
        """Restart the device (``RS``), which clears an error, and wait until it answers again.

        Settings that were not saved are lost and have to be made again.

        Raises
        ------
        Timeout
            When it does not answer again within 5 s.
        """
        clock = self.link.clock
        self.session.request("RS")
        end = clock.now() + START_UP_S
        clock.sleep(0.25)  # the device still answers for about 200 ms before it resets
        while self._starting():
            if clock.now() > end:
                raise Timeout(
                    self.device, f"did not answer again within {START_UP_S:g} s of a reset", "check its power"
                )
            clock.sleep(0.1)
        self._set_up()

    def get_number(self, key: int) -> float:
        """Query one parameter."""
        return self.session.get(key, instance=self._instance_of(key))

    def set_number(self, key: int, value: float) -> None:
        """Set one parameter."""
        self.session.set(key, value, instance=self._instance_of(key))

    def _make_safe(self) -> None:
        self.off()
        self.host_watchdog_s = 0.0

    def _instance_of(self, key: int) -> int:
        return 1 if PARAMETERS[key].common else self.instance

    def _starting(self) -> bool:
        try:
            return self.device_status not in (DeviceStatus.READY, DeviceStatus.RUN, DeviceStatus.ERROR)
        except (Timeout, ProtocolError):
            return True  # it does not answer while it starts

    def _set_up(self) -> None:
        self.flash_saving_off = True
        self.host_watchdog_s = self.watchdog_s

    def _switch(self, wanted: OutputEnable) -> None:
        self.output_enable = wanted
        if (found := self.output_enable) is not wanted:
            raise DeviceFault(self.device, f"output is {found.name} after it was set to {wanted.name}")

    def _refuse_problem(self) -> None:
        if number := self.error_number:
            what = f"error {number}: {ERRORS.get(number, 'unknown')}"
            raise DeviceFault(self.device, what, "find the cause, then reset the controller", code=number)

    def _problem(self) -> str:
        number = self.error_number
        return f"error {number}: {ERRORS.get(number, 'unknown')}" if number else ""
