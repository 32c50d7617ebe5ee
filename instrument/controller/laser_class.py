"""Class 1 limits of IEC 60825-1:2014 for a pulse train at 700 to 1050 nm, as pure functions. Not a certification.

A small source (C6 = 1, C7 = 1), measured through 7 mm at 100 mm. Three limits hold at once (clause 4.3): the
single pulse, the mean power over the time base, and the single pulse reduced by C5. Pulses inside Ti count as one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

EDITION = "IEC 60825-1:2014 (edition 3), class 1, C6 = C7 = 1; a calculation, not a certification"
MIN_NM, MAX_NM = 700.0, 1050.0
T_I_S = 5e-6  # pulses closer than this are summed
T_BASE_S = 10.0  # T2 of a small source: pulses are counted over it
SHORT_S, SHORTEST_S = 1e-11, 1e-13


@dataclass(frozen=True)
class PulseTrain:
    """Light that leaves the aperture.

    Attributes
    ----------
    wavelength_nm : float
        700 to 1050.
    prf_hz : float
        Pulses per second.
    pulse_energy_nj : float
    pulse_width_s : float
        Full width at half maximum, 0.1 ps to 5 us.
    """

    wavelength_nm: float
    prf_hz: float
    pulse_energy_nj: float
    pulse_width_s: float

    def __post_init__(self) -> None:
        for name, least, most in (
            ("wavelength_nm", MIN_NM, MAX_NM),
            ("prf_hz", 1.0 / T_BASE_S, 1e9),
            ("pulse_energy_nj", 0.0, 1e12),
            ("pulse_width_s", SHORTEST_S, T_I_S),
        ):
            value = getattr(self, name)
            if not least <= value <= most:
                raise ValueError(f"{name} {value:g} is outside {least:g} to {most:g}, where these limits hold")


@dataclass(frozen=True)
class LaserClass:
    """Limits for a pulse train, and whether it keeps them.

    Attributes
    ----------
    ael_mw : float
        Mean power allowed for longer than 10 s.
    mean_power_mw : float
        Mean power of the train.
    single_pulse_ael_nj : float
        Energy allowed for one pulse alone.
    limits_nj : dict
        Energy allowed per pulse by each rule: ``single pulse``, ``mean power``, ``pulse train``.
    class1 : bool
        Whether the pulse energy is within all three.
    """

    ael_mw: float
    mean_power_mw: float
    single_pulse_ael_nj: float
    limits_nj: dict[str, float]
    class1: bool

    @property
    def pulse_limit_nj(self) -> float:
        """Get the lowest of the limits."""
        return min(self.limits_nj.values())


def c4(wavelength_nm: float) -> float:
    """Correction for the absorption of the eye's pigment, ``10^(0.002 (wavelength - 700))``, 700 to 1050 nm."""
    return float(10.0 ** (0.002 * (wavelength_nm - MIN_NM)))


def c5(pulses: float) -> float:
    """Correction for the number of pulses (not longer than Ti): 1 up to 600, then ``5 N^-1/4`` down to 0.4."""
    return 1.0 if pulses <= 600 else min(1.0, max(0.4, 5.0 * pulses**-0.25))


def single_pulse_ael_nj(wavelength_nm: float, pulse_width_s: float) -> float:
    """Energy (nJ) that class 1 allows for one pulse of 0.1 ps to 5 us."""
    return 38.0 if pulse_width_s < SHORT_S else 77.0 * c4(wavelength_nm)


def mean_power_ael_mw(wavelength_nm: float) -> float:
    """Power (mW) that class 1 allows for longer than 10 s: ``0.39 C4 C7``."""
    return 0.39 * c4(wavelength_nm)


def classify(train: PulseTrain) -> LaserClass:
    """Compare a pulse train with the limits of class 1.

    Notes
    -----
    At rates above 1 / Ti several pulses fall into one Ti and are taken as one, so that each may have only its share.
    """
    single_nj = single_pulse_ael_nj(train.wavelength_nm, train.pulse_width_s)
    mean_mw = mean_power_ael_mw(train.wavelength_nm)
    together = max(1, math.ceil(round(T_I_S * train.prf_hz, 9)))
    groups = train.prf_hz * T_BASE_S / together
    limits = {
        "single pulse": single_nj / together,
        "mean power": mean_mw * 1e6 / train.prf_hz,
        "pulse train": c5(groups) * single_nj / together,
    }
    return LaserClass(
        ael_mw=mean_mw,
        mean_power_mw=train.pulse_energy_nj * train.prf_hz * 1e-6,
        single_pulse_ael_nj=single_nj,
        limits_nj=limits,
        class1=train.pulse_energy_nj <= min(limits.values()),
    )
