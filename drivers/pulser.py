"""The laser pulser: delay generator for the triggers and supply for the drive voltage, as one device.

On: supply first, triggers once its voltage has settled. Off: triggers first. Each step is read back
(protocol sheet ``tdk_genesys``, section on the pulser as seen by the software).
"""

from __future__ import annotations

from picoradar.drivers.clock import Clock
from picoradar.drivers.dg645 import DG645, Channel, Inhibit, InstrumentStatus, Output, TriggerSource
from picoradar.drivers.errors import DeviceError, DeviceFault, LimitError, carry_out_all, check_range
from picoradar.drivers.genesys import Fault, Genesys, Status
from picoradar.drivers.interfaces import DRIVE_V, PRF_HZ, Identity, PulserStatus

OVERVOLTAGE_V = 350.0
UNDERVOLTAGE_V = 0.0
CURRENT_A = 0.1
TOLERANCE = 0.01
POLL_S = 0.05


class Pulser:
    """Trigger source and drive supply of the laser; satisfies `picoradar.drivers.interfaces.Pulser`.

    Parameters
    ----------
    generator : DG645
        Gives the laser trigger on output AB.
    supply : Genesys
        Gives the drive voltage.
    clock : Clock
        Time for waiting until the voltage has settled.
    pulse_delay_s, pulse_width_s : float
        Delay of the trigger pulse after T0, and its width.
    amplitude_v : float
        Amplitude of the trigger pulse into 50 ohm.
    rise_limit_s : float
        Time within which the supply must be within 1 % of the drive voltage.
    """

    def __init__(
        self,
        generator: DG645,
        supply: Genesys,
        clock: Clock,
        *,
        pulse_delay_s: float = 0.0,
        pulse_width_s: float = 100e-9,
        amplitude_v: float = 3.3,
        rise_limit_s: float = 5.0,
    ) -> None:
        self.generator = generator
        self.supply = supply
        self.clock = clock
        self.pulse_delay_s = pulse_delay_s
        self.pulse_width_s = pulse_width_s
        self.amplitude_v = amplitude_v
        self.rise_limit_s = rise_limit_s

    @property
    def found_on(self) -> tuple[str, ...]:
        """Get what of the two was on when they were opened: ``triggers``, ``supply``."""
        return (*self.generator.found_on, *self.supply.found_on)

    def open(self) -> None:
        """Open both devices with everything off, set the trigger pulse and the limits of the supply.

        Both are opened even if one fails: the other can then be switched off.
        """
        carry_out_all(self.generator.open, self.supply.open)
        self.generator.inhibit = Inhibit.TRIGGERS
        self.generator.burst = False
        self.generator.set_delay(Channel.A, Channel.T0, self.pulse_delay_s)
        self.generator.set_delay(Channel.B, Channel.A, self.pulse_width_s)
        self.generator.output(Output.AB).amplitude_v = self.amplitude_v
        self.supply.protect(overvoltage_v=OVERVOLTAGE_V, undervoltage_v=UNDERVOLTAGE_V, current_a=CURRENT_A)

    def close(self) -> None:
        """Switch both off and close their links; both are tried even if one fails."""
        carry_out_all(self.generator.close, self.supply.close)

    def identify(self) -> Identity:
        """Get both devices as one: models, serial numbers and firmware joined by ``+``."""
        pair = (self.generator.identify(), self.supply.identify())
        return Identity(
            model=" + ".join(one.model for one in pair),
            serial_number=" + ".join(one.serial_number for one in pair),
            firmware=" + ".join(one.firmware for one in pair),
        )

    def configure(self, *, prf_hz: float, drive_v: float) -> None:
        """Switch everything off, set rate (Hz, 20e3 to 240e3) and drive voltage (V, 240 to 330), and read both back.

        Parameters
        ----------
        prf_hz : float
            20e3 to 240e3.
        drive_v : float
            240 to 330.

        Raises
        ------
        LimitError
            When a value is out of range, or the period is not longer than the trigger pulse's end (a trigger
            that comes during a cycle is ignored); nothing was sent.
        DeviceFault
            When a value read back differs.
        """
        name = self.generator.device
        check_range(name, "PRF", prf_hz, *PRF_HZ, "Hz")
        check_range(self.supply.device, "drive voltage", drive_v, *DRIVE_V, "V")
        busy_s = self.pulse_delay_s + self.pulse_width_s
        if busy_s >= 1 / prf_hz:
            what = f"a cycle of {busy_s:g} s does not fit in a period of {1 / prf_hz:g} s; nothing was sent"
            raise LimitError(name, what, "lower the PRF or shorten the trigger pulse")
        self.off()
        self.generator.trigger_rate_hz = prf_hz
        self.supply.voltage_v = drive_v
        if abs((found := self.generator.trigger_rate_hz) - prf_hz) > 1e-5:
            raise DeviceFault(name, f"rate is {found:g} Hz after it was set to {prf_hz:g} Hz")
        if abs((found := self.supply.voltage_v) - drive_v) > 0.01:
            raise DeviceFault(self.supply.device, f"set point is {found:g} V after it was set to {drive_v:g} V")

    def on(self) -> None:
        """Switch the supply on, wait until it is within 1 %, then start the triggers; each step read back.

        Raises
        ------
        DeviceError
            When a step fails; both have then been switched off again as far as they answer.
        """
        try:
            self.supply.switch(on=True)
            self._wait_for_voltage()
            self.generator.start_triggers()
        except DeviceError as error:
            try:
                self.off()
            except DeviceError as second:
                error.add_note(f"and could not be switched off: {second}")
            raise

    def off(self) -> None:
        """Stop the triggers, then the supply; both are tried even if one fails, each is read back.

        The voltage falls with the supply's own time constant: `status` reports it.
        """
        carry_out_all(self.generator.stop_triggers, lambda: self.supply.switch(on=False))

    def watch(self) -> bool | None:
        """Ask both devices without waiting; returns whether both are on once both answers have come.

        Costs no time: each call takes what has come to the questions of the calls before, and asks again.

        Raises
        ------
        Timeout, ProtocolError, LinkLost
            When an answer is overdue: the device, or the cable to it, has gone, and could not be switched off.
        """
        answers = (self.generator.triggers_answer(), self.supply.output_answers())
        return False if False in answers else None if None in answers else True

    def status(self) -> PulserStatus:
        """Measure the present state of both devices."""
        source = self.generator.trigger_source
        rate_hz = self.generator.trigger_rate_hz
        events = self.generator.instrument_status()
        supply = self.supply.state()
        return PulserStatus(
            triggers_on=source is not TriggerSource.SINGLE_SHOT,
            output_on=bool(supply.status & (Status.CONSTANT_VOLTAGE | Status.CONSTANT_CURRENT)),
            interlock_closed=not supply.fault & Fault.INTERLOCK,
            prf_hz=rate_hz,
            drive_v=supply.voltage_v,
            measured_v=supply.measured_v,
            measured_a=supply.measured_a,
            problem="; ".join(_problems(events, supply.fault)),
        )

    def _wait_for_voltage(self) -> None:
        wanted_v = self.supply.voltage_v
        end = self.clock.now() + self.rise_limit_s
        while abs((measured_v := self.supply.measured_v) - wanted_v) > TOLERANCE * wanted_v:
            if self.clock.now() >= end:
                what = f"output is {measured_v:g} V, not {wanted_v:g} V, {self.rise_limit_s:g} s after switching on"
                raise DeviceFault(self.supply.device, what, "check the load and the current limit")
            self.clock.sleep(POLL_S)


def _problems(events: InstrumentStatus, fault: Fault) -> list[str]:
    found = []
    if events & InstrumentStatus.RATE:
        found.append("triggers came while a cycle still ran")
    if events & InstrumentStatus.INHIBITED:
        found.append("triggers were inhibited")
    if fault:
        found.append(f"supply fault {fault.value:02X}: {fault.name or ''}".replace("|", ", "))
    return found
