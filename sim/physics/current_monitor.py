"""`CurrentMonitor`: the voltage that the current pulse makes at the resistor R_M, behind an attenuator."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.noise import Noise
from picoradar.sim.physics.oscilloscope import NOISE_MV, coded
from picoradar.sim.physics.thermal import DiodeBlock
from picoradar.sim.physics.transmitter import Transmitter
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.wires import Acquisition, Supply, TriggerLine

R_M_OHM = 0.25  # two thin film resistors of 0.5 ohm in parallel (section 2.6.1)
ATTENUATION = 50.0  # chosen: 4.9 V of 19.7 A become 99 mV, which the oscilloscope takes
PEAK_PS = 5000.0  # of the pulse at 20 kHz after the trigger; chosen


class CurrentMonitor:
    """Implements `picoradar.sim.wires.SignalSource` for an oscilloscope at R_M (dissertation, section 2.6.1, fig 2.7).

    Parameters
    ----------
    settings : SimulationSettings
    noise : Noise
    trigger : TriggerLine
        Laser triggers before the gate.
    supply : Supply
        Drive voltage.
    block : DiodeBlock
        Temperature of the diode.
    """

    def __init__(
        self, settings: SimulationSettings, noise: Noise, trigger: TriggerLine, supply: Supply, block: DiodeBlock
    ) -> None:
        self._current_noise = settings.current_noise
        self._noise = noise
        self._trigger = trigger
        self._supply = supply
        self._block = block
        self._transmitter = Transmitter(settings)
        self._clipped = False

    @property
    def clipped(self) -> bool:
        """Get whether any sample of the last window was clipped."""
        return self._clipped

    def acquire(self, wanted: Acquisition) -> NDArray[np.uint32]:
        """Take one window; see `picoradar.sim.wires.SignalSource.acquire`."""
        rng = self._noise.stream("current_monitor", *wanted.key)
        shape = (wanted.sweeps, wanted.samples)
        signal_mv = rng.normal(0.0, NOISE_MV, shape)
        if wanted.gate_open and self._trigger.rate_hz > 0:
            drive_v, degc = self._supply.output_v(), self._block.temperature_degc()
            pulse = self._transmitter.current(drive_v, degc, self._trigger.rate_hz)
            after_ns = (wanted.delay_ps + wanted.step_ps * np.arange(wanted.samples) - PEAK_PS) * 1e-3 - pulse.delay_ns
            mean_mv = np.array([pulse.at(time_ns) for time_ns in after_ns.tolist()]) * (1e3 * R_M_OHM / ATTENUATION)
            signal_mv += mean_mv * (1.0 + self._current_noise * rng.standard_normal(shape))
        sums, self._clipped = coded(signal_mv)
        return sums
