"""What may leave the aperture at a setting, and how far it is from the limit of class 1.

The radar does not measure its output power; it is known from measurements with a power meter at the exit, which
the settings carry. The pulse energy grows with the drive voltage, so a measurement at the same or a higher voltage
bounds it from above; above the highest measured voltage nothing is known, and the setting is refused. A margin
covers the power meter and the temperature. It is a calculation, not a certification.
"""

from __future__ import annotations

from dataclasses import dataclass

from picoradar.instrument.controller.laser_class import EDITION, LaserClass, PulseTrain, classify
from picoradar.instrument.errors import InterlockTripped
from picoradar.instrument.settings import PulserSettings

WAVELENGTH_NM = 904.0
PULSE_WIDTH_S = 45e-12
NAME = "laser class"


@dataclass(frozen=True)
class Exposure:
    """Upper bound of the light of one setting.

    Attributes
    ----------
    pulse_energy_nj : float
        Most that one pulse can have at the exit, margin included.
    """

    pulse_energy_nj: float

    def classified(self, prf_hz: float) -> LaserClass:
        """Compare with the limits of class 1 at a rate (Hz)."""
        return classify(PulseTrain(WAVELENGTH_NM, prf_hz, self.pulse_energy_nj, PULSE_WIDTH_S))

    def share(self, prf_hz: float) -> float:
        """Get the pulse energy as a share of the lowest limit at a rate (Hz); above 1 is not class 1, 0 is no light."""
        return self.pulse_energy_nj / self.classified(prf_hz).pulse_limit_nj if prf_hz > 0 else 0.0


def exposure_of(pulser: PulserSettings) -> Exposure:
    """Bound the pulse energy of a setting by the measurements.

    Raises
    ------
    InterlockTripped
        When no measurement was made at this drive voltage or above.
    """
    above = [(drive_v, mw / hz * 1e6) for drive_v, hz, mw in pulser.measured_output if drive_v >= pulser.drive_v]
    if not above:
        highest_v = max(point[0] for point in pulser.measured_output)
        raise InterlockTripped(
            NAME,
            f"the output power was never measured at {pulser.drive_v:g} V or above (highest {highest_v:g} V); "
            "measure it at the exit with the laser class's precautions and add it to pulser.measured_output",
        )
    lowest_v = min(drive_v for drive_v, _ in above)
    return Exposure(max(energy_nj for drive_v, energy_nj in above if drive_v == lowest_v) * pulser.output_margin)


def refuse_above_class_1(pulser: PulserSettings) -> Exposure:
    """Refuse a setting whose light may exceed class 1, before anything is switched.

    Raises
    ------
    InterlockTripped
        With the energy, the limit and the edition of the standard.
    """
    exposure = exposure_of(pulser)
    found = exposure.classified(pulser.prf_hz)
    if not found.class1:
        raise InterlockTripped(
            NAME,
            f"{exposure.pulse_energy_nj:.3g} nJ a pulse at {pulser.prf_hz:g} Hz and {pulser.drive_v:g} V are above the "
            f"{found.pulse_limit_nj:.3g} nJ of {EDITION}; lower rate or drive voltage",
        )
    return exposure
