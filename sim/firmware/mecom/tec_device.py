"""The simulated temperature controller behind its protocol: parameters, errors, watchdog, reset.

An error switches the output off and is latched until a reset (protocol sheet ``mecom_tec``).
"""

from __future__ import annotations

from collections.abc import Callable

from picoradar.drivers.clock import Clock, Timer
from picoradar.drivers.mecom import DeviceStatus, OutputEnable
from picoradar.sim.firmware.mecom.memory import Memory
from picoradar.sim.firmware.mecom.tec_loop import PELTIER_OHM, TemperatureLoop
from picoradar.sim.wires import HeatPump

RESET_S = 0.2
START_UP_S = 1.0
SHORTEST_WATCHDOG_S = 0.1
EMERGENCY_STOP, WATCHDOG_EXPIRED = 11, 183
OUTPUT_ENABLE, LIVE_ENABLE, WATCHDOG = 2010, 50000, 2060
ROUNDING_S = 1e-9
DEVICE_DEGC = 31.5
WRITTEN_ONLY = (52000, 52001)  # start and stop of a look-up table read as 0


class OutOfRange(ValueError):
    """A value that the device does not accept."""


class TecDevice:
    """One temperature controller without its serial line.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    heat_pump : HeatPump
        What it drives and measures.
    memory : Memory
        Its parameters.
    restarted : callable
        Called when a reset is carried out.
    """

    def __init__(self, clock: Clock, heat_pump: HeatPump, memory: Memory, restarted: Callable[[], None]) -> None:
        self.clock = clock
        self.memory = memory
        self.loop = TemperatureLoop(clock, heat_pump, memory.values, self.trip)
        self._status = DeviceStatus.READY
        self._error = (0, 0)
        self._last_heard_s = clock.now()
        self._watchdog: Timer | None = None
        self._restarted = restarted
        self._readings = self._reading_table(heat_pump)

    @property
    def answers(self) -> bool:
        """Get whether it answers, which it does not while it starts up."""
        return self._status is not DeviceStatus.INIT

    @property
    def last_heard_s(self) -> float:
        """Get when the host was last heard."""
        return self._last_heard_s

    def heard(self) -> None:
        """Feed the watchdog."""
        self._last_heard_s = self.clock.now()

    def value(self, number: int, pin: int = 1) -> float:
        """Get a parameter; ``pin`` chooses among those that every pin has for its own."""
        if (number, pin) in self.memory.pins:
            return self.memory.pins[number, pin]
        read = self._readings.get(number)
        return read() if read is not None else self.memory.values[number]

    def set(self, number: int, value: float, pin: int = 1) -> None:
        """Set a parameter that is in its range by the table.

        Raises
        ------
        OutOfRange
            For a watchdog time between 0 and 0.1 s.
        """
        if number == WATCHDOG and 0 < value < SHORTEST_WATCHDOG_S:
            raise OutOfRange(value)
        self.memory.set(number, value, pin)
        if number in (OUTPUT_ENABLE, LIVE_ENABLE):
            self._switch()
        elif number == WATCHDOG:
            self._arm()

    def trip(self, error: int, parameter: int = 0) -> None:
        """Latch an error and switch the output off."""
        if not self._error[0]:
            self._error = (error, parameter)
        self._status = DeviceStatus.ERROR
        self.memory.values[OUTPUT_ENABLE] = OutputEnable.OFF
        self.loop.stop()

    def stop(self) -> None:
        """Carry out the emergency stop."""
        self.trip(EMERGENCY_STOP)

    def reset(self) -> None:
        """Switch the output off, and restart 0.2 s later."""
        self.loop.stop()
        self._status = DeviceStatus.ABOUT_TO_RESET
        self.clock.call_at(self.clock.now() + RESET_S, self._restart)

    def _reading_table(self, pump: HeatPump) -> dict[int, Callable[[], float]]:
        """Build the table of parameters that are measured or reported, not set."""
        loop = self.loop
        return {
            104: self._device_status,
            105: lambda: self._error[0],
            106: lambda: 1 if self._error[0] else 0,
            107: lambda: self._error[1],
            109: lambda: self.memory.flash_state,
            1000: pump.temperature_degc,
            1001: pump.sink_degc,
            1010: lambda: self.memory.values[3000],
            1011: lambda: loop.nominal_degc if loop.running else pump.temperature_degc(),
            1012: lambda: loop.current_a if loop.stability else 0.0,
            1020: lambda: loop.current_a,
            1021: lambda: loop.current_a * PELTIER_OHM,
            1032: lambda: loop.control_percent,
            1063: lambda: DEVICE_DEGC,
            1200: lambda: loop.stability,
            **dict.fromkeys(WRITTEN_ONLY, lambda: 0.0),
        }

    def _device_status(self) -> DeviceStatus:
        running = self._status is DeviceStatus.READY and self.loop.running
        return DeviceStatus.RUN if running else self._status

    def _switch(self) -> None:
        """Bring the output to what parameter 2010 says; the hardware pin of this bench is off."""
        wanted = self.memory.values[OUTPUT_ENABLE]
        live = wanted == OutputEnable.LIVE and bool(self.memory.values[LIVE_ENABLE])
        if (wanted == OutputEnable.ON or live) and self._status is DeviceStatus.READY:
            self.loop.start()
        else:
            self.loop.stop()

    def _arm(self) -> None:
        """Set the watchdog's timer to the moment at which silence will have lasted too long."""
        if self._watchdog is not None:
            self._watchdog.cancel()
            self._watchdog = None
        if limit_s := self.memory.values[WATCHDOG]:
            self._watchdog = self.clock.call_at(self._last_heard_s + limit_s, self._check_silence)

    def _check_silence(self) -> None:
        # One timer in flight, moved on when it falls due: cheaper than a new one for every telegram.
        if self.clock.now() - self._last_heard_s < self.memory.values[WATCHDOG] - ROUNDING_S:
            self._arm()
            return
        self._watchdog = None
        self.trip(WATCHDOG_EXPIRED, WATCHDOG)

    def _restart(self) -> None:
        self._status = DeviceStatus.INIT
        self._error = (0, 0)
        self.memory.reload()
        self._restarted()
        self.clock.call_at(self.clock.now() + START_UP_S, self._ready)

    def _ready(self) -> None:
        self._status = DeviceStatus.READY
        self.heard()
        self._arm()
