"""`Transmitter`: the laser pulse for a supply voltage and a diode temperature."""

from __future__ import annotations

import math
from typing import NamedTuple

from sim.settings import SimulationSettings

GAUSS_RISE_PER_FWHM = 0.7164  # 10-90 % rise of a Gaussian pulse


class LaserPulse(NamedTuple):
    """Optical pulse at the diode: ``peak_w``, ``fwhm_ps`` and ``rise_ps`` (10-90 %) of a Gaussian, and
    ``delay_ps`` of its centre after the trigger."""

    peak_w: float
    fwhm_ps: float
    delay_ps: float

    @property
    def rise_ps(self) -> float:
        """Get the rise time from 10 to 90 % (ps)."""
        return GAUSS_RISE_PER_FWHM * self.fwhm_ps

    @property
    def energy_pj(self) -> float:
        """Get the energy (pJ)."""
        return self.peak_w * self.fwhm_ps * math.sqrt(math.pi / math.log(2)) / 2


class Transmitter:
    """Avalanche pulser and single heterostructure laser diode (dissertation, section 2.3).

    Strong and fast carrier injection suppresses the normal mode; the diode then emits one spike of 44 ps. Below
    about 270 V the injection does not reach that, and a weak pulse of 637 ps is left.
    """

    def __init__(self, settings: SimulationSettings) -> None:
        self._settings = settings

    def pulse(self, drive_v: float, diode_degc: float) -> LaserPulse:
        """Get the pulse that a trigger gives.

        Parameters
        ----------
        drive_v : float
            Voltage at the pulser.
        diode_degc : float
            Temperature of the diode.
        """
        injection = 1.0 / (1.0 + math.exp(-(drive_v - 281.0 - 4.0 * (23.0 - diode_degc)) / 2.5))
        peak_w = 2.5 + 129.2 * injection * (1.0 + 0.0101 * (drive_v - 290.0)) * math.exp(
            -max(0.0, diode_degc - 23.0) / 20.0
        )
        fwhm_ps = 43.5 + (637.0 - 43.5) * (1.0 - injection) ** 2
        delay_ps = self._settings.current_delay_ps + 4500.0 + 50.0 * (diode_degc - 23.0)
        return LaserPulse(peak_w * max(0.0, min(1.0, drive_v / 240.0)) ** 4, fwhm_ps, delay_ps)

    def electrical_power_w(self, drive_v: float, prf_hz: float) -> float:
        """Get the mean power (W) that the pulser takes from the supply for its capacitor, C V^2 f."""
        return self._settings.storage_capacitance_pf * 1e-12 * drive_v**2 * prf_hz
