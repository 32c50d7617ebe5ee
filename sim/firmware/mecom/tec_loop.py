"""Temperature loop of the simulated TEC: ramp, PI(D) controller, stability, error thresholds.

One step every 0.1 s while the output is on; no timer while it is off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from picoradar.drivers.clock import Clock, Timer
from picoradar.drivers.mecom import OutputStageInput, Stability
from picoradar.sim.wires import HeatPump

STEP_S = 0.1
PELTIER_OHM = 2.0
OVER_CURRENT, OVER_VOLTAGE = 100, 104
TOO_COLD, TOO_HOT, TOO_FAST, NOT_STABLE_IN_TIME = 137, 138, 139, 182
SLOWEST_RAMP = 0.1  # of the ramp, near the target


class TemperatureLoop:
    """Drives a heat pump by the parameters of the device.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    heat_pump : HeatPump
        Diode block with its Peltier element.
    values : mapping
        The device's parameters by number; read at every step.
    trip : callable
        Called with an error number (and the parameter's) when a threshold is crossed.
    """

    def __init__(
        self,
        clock: Clock,
        heat_pump: HeatPump,
        values: Mapping[int, float],
        trip: Callable[[int, int], None],
    ) -> None:
        self.clock = clock
        self.heat_pump = heat_pump
        self.values = values
        self.trip = trip
        self.current_a = 0.0
        self.nominal_degc = 0.0
        self.control_percent = 0.0
        self._timer: Timer | None = None
        self._integral = 0.0  # in % of the current limit
        self._last_degc = 0.0
        self._in_band_s = 0.0
        self._on_s = 0.0

    @property
    def running(self) -> bool:
        """Get whether the output is on."""
        return self._timer is not None

    @property
    def stability(self) -> Stability:
        """Get parameter 1200."""
        if not self.running or self.values[2000] != OutputStageInput.TEMPERATURE_CONTROLLER:
            return Stability.NOT_REGULATING
        return Stability.STABLE if self._in_band_s >= self.values[4041] else Stability.NOT_STABLE

    def start(self) -> None:
        """Switch the output on; the ramp starts at the present temperature."""
        if self.running:
            return
        self.nominal_degc = self._last_degc = self.heat_pump.temperature_degc()
        self._integral = self._in_band_s = self._on_s = 0.0
        self._timer = self.clock.every(STEP_S, self._step)

    def stop(self) -> None:
        """Switch the output off."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self.control_percent = 0.0
        self._drive(0.0)

    def _step(self) -> None:
        values = self.values
        object_degc = self.heat_pump.temperature_degc()
        slope = (object_degc - self._last_degc) / STEP_S
        self._last_degc = object_degc
        self._on_s += STEP_S
        if error := self._crossed(object_degc, slope):
            self.trip(*error)
        elif values[2000] == OutputStageInput.TEMPERATURE_CONTROLLER:
            self._ramp()
            self._regulate(object_degc, slope)
            self._judge(object_degc)
        else:
            maximum = abs(values[2021]) / PELTIER_OHM
            self.control_percent = 0.0
            self._drive(max(-maximum, min(maximum, values[2020])))

    def _ramp(self) -> None:
        """Move the nominal temperature towards the target, slower within the proximity width."""
        target, ramp, width = self.values[3000], self.values[3003], self.values[3002]
        left = target - self.nominal_degc
        if not ramp:
            self.nominal_degc = target
            return
        slower = min(1.0, max(SLOWEST_RAMP, abs(left) / width)) if width else 1.0
        maximum = ramp * slower * STEP_S
        self.nominal_degc += max(-maximum, min(maximum, left))

    def _regulate(self, object_degc: float, slope: float) -> None:
        kp, ti, td = self.values[3010], self.values[3011], self.values[3012]
        error = self.nominal_degc - object_degc
        integral = self._integral + (kp * error * STEP_S / ti if ti else 0.0)
        percent = kp * (error - td * slope) + integral
        if abs(percent) <= 100:  # anti-windup while the output is at its limit
            self._integral = integral
        self.control_percent = max(-100.0, min(100.0, percent))
        self._drive(self.control_percent / 100 * self.values[2030])

    def _judge(self, object_degc: float) -> None:
        inside = abs(object_degc - self.values[3000]) <= self.values[4040]
        self._in_band_s = self._in_band_s + STEP_S if inside else 0.0
        longest = self.values[4042]
        if longest and self._on_s > longest and self.stability is not Stability.STABLE:
            self.trip(NOT_STABLE_IN_TIME, 4042)

    def _crossed(self, object_degc: float, slope: float) -> tuple[int, int] | None:
        if object_degc < self.values[4010]:
            return TOO_COLD, 4010
        if not object_degc <= self.values[4011]:  # a broken sensor reads no number
            return TOO_HOT, 4011
        if abs(slope) > self.values[4012]:
            return TOO_FAST, 4012
        if abs(self.current_a) > self.values[2032]:
            return OVER_CURRENT, 2032
        if abs(self.current_a) * PELTIER_OHM > self.values[2033]:
            return OVER_VOLTAGE, 2033
        return None

    def _drive(self, current_a: float) -> None:
        maximum = min(self.values[2030], self.values[2031] / PELTIER_OHM)
        self.current_a = max(-maximum, min(maximum, current_a))
        self.heat_pump.drive(self.current_a)
