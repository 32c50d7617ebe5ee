"""`LaserMonitor`: a fast photodetector and a power meter at the exit, which measure the laser itself."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.noise import Noise
from picoradar.sim.physics.oscilloscope import NOISE_MV, coded
from picoradar.sim.physics.thermal import DiodeBlock
from picoradar.sim.physics.transmitter import LaserPulse, Transmitter
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.wires import Acquisition, Supply, TriggerLine

MV_PER_W = 0.5
JITTER_PS = 1.0
METER_SHARE = 0.01  # standard deviation of a reading of the power meter


class LaserMonitor:
    """Implements `picoradar.sim.wires.SignalSource` for an oscilloscope that is faster than the laser pulse.

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
    gate_open : callable
        Whether triggers reach the laser.
    """

    def __init__(
        self,
        settings: SimulationSettings,
        noise: Noise,
        trigger: TriggerLine,
        supply: Supply,
        block: DiodeBlock,
        gate_open: Callable[[], bool],
    ) -> None:
        self._settings = settings
        self._noise = noise
        self._trigger = trigger
        self._supply = supply
        self._block = block
        self._gate_open = gate_open
        self._transmitter = Transmitter(settings)
        self._readings = 0
        self._clipped = False

    @property
    def clipped(self) -> bool:
        """Get whether any sample of the last window was clipped."""
        return self._clipped

    def acquire(self, wanted: Acquisition) -> NDArray[np.uint32]:
        """Take one window; see `picoradar.sim.wires.SignalSource.acquire`."""
        rng = self._noise.stream("laser_monitor", *wanted.key)
        shape = (wanted.sweeps, wanted.samples)
        signal_mv = rng.normal(0.0, NOISE_MV, shape)
        if wanted.gate_open:
            times_ps = wanted.delay_ps + wanted.step_ps * np.arange(wanted.samples) + rng.normal(0, JITTER_PS, shape)
            laser, weak = self._pulses()
            missed = rng.random(shape) < laser.misfire_share
            energy = 1.0 + laser.energy_noise * rng.standard_normal(shape)
            signal_mv += MV_PER_W * np.where(missed, _at(weak, times_ps), energy * _at(laser, times_ps))
        sums, self._clipped = coded(signal_mv)
        return sums

    def mean_power_mw(self) -> float:
        """Read the power meter at the exit."""
        self._readings += 1
        if not self._gate_open() or self._trigger.rate_hz <= 0:
            return 0.0
        laser, weak = self._pulses()
        energy_pj = laser.energy_pj + laser.misfire_share * (weak.energy_pj - laser.energy_pj)
        error = 1.0 + METER_SHARE * self._noise.stream("power_meter", self._readings).standard_normal()
        return float(energy_pj * 1e-9 * self._trigger.rate_hz * self._settings.exit_transmission * error)

    def _pulses(self) -> tuple[LaserPulse, LaserPulse]:
        drive_v, rate_hz = self._supply.output_v(), self._trigger.rate_hz
        laser = self._transmitter.pulse(drive_v, self._block.temperature_degc(), rate_hz)
        return laser, self._transmitter.misfire(drive_v, laser.delay_ps)


def _at(pulse: LaserPulse, times_ps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Power (W) of a pulse at some times."""
    return np.asarray(pulse.peak_w * np.exp(-4 * np.log(2) * ((times_ps - pulse.delay_ps) / pulse.fwhm_ps) ** 2))
