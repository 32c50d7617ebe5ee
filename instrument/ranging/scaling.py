"""Constants of ranging for other instruments: times in units of the pulse width, levels in codes of the digitiser."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from picoradar.instrument.errors import BadInput

FWHM_PS, CODE_MV = 600.0, 0.5  # of the dissertation's receiver and of its A/D, which the defaults are for
USUAL_RISE = 0.72  # of a Gaussian pulse: rise from 10 to 90 % over full width at half maximum

Settings = TypeVar("Settings", bound=Any)


@dataclass(frozen=True)
class OtherPulse:
    """What must be known of another instrument to range its traces, in volts or counts as they come.

    Parameters
    ----------
    fwhm_ps : float
        Full width at half maximum of a usual pulse, as its traces show it (ps).
    step_ps : float
        Sampling step of its traces (ps).
    rise_ps : float, optional
        From 10 to 90 % (ps); without it that of a Gaussian pulse.
    code : float
        One step of the digitiser, in the unit of the traces: 1 for counts.
    full_scale : (float, float)
        Ends of the digitiser, in that unit: a record with a sample there is clipped. ``-inf`` or ``inf`` where there is
        none (a trace whose baseline rests at 0 on purpose).

    Raises
    ------
    BadInput
        When a width, step or code is not positive, the pulse is narrower than two samples, or full scale is empty.

    Examples
    --------
    Counts of 8 bit in bins of 1 ns, pulses of 5 ns:

    >>> from picoradar.instrument.ranging import OtherPulse, RangingSettings
    >>> pulse = OtherPulse(fwhm_ps=5000.0, step_ps=1000.0, full_scale=(0.0, 255.0))
    >>> RangingSettings.for_pulse(pulse).narrowest_ps
    2500.0
    """

    fwhm_ps: float
    step_ps: float
    rise_ps: float | None = None
    code: float = 1.0
    full_scale: tuple[float, float] = (0.0, 255.0)

    def __post_init__(self) -> None:
        if not min(self.fwhm_ps, self.step_ps, self.rise_ps_or_usual, self.code) > 0:
            raise BadInput(f"width, step, rise and code of a pulse must be positive: {self}")
        if self.fwhm_ps < 2 * self.step_ps:
            raise BadInput(
                f"a pulse of {self.fwhm_ps:g} ps in steps of {self.step_ps:g} ps has no edge to see; "
                "give traces with at least two samples in the width of a pulse"
            )
        if not self.full_scale[0] < self.full_scale[1]:
            raise BadInput(f"full scale must be (lowest, highest), not {self.full_scale}")

    @property
    def rise_ps_or_usual(self) -> float:
        """Get the rise time (ps), of a Gaussian pulse where it was not given."""
        return USUAL_RISE * self.fwhm_ps if self.rise_ps is None else self.rise_ps


def scaled(settings: Settings, pulse: OtherPulse, **own: float | tuple[float, float]) -> Settings:
    """Return settings with their times (``..._ps``) in proportion to the width of the pulse, and their levels
    (``..._mv``, ``..._mv2``) to the code; those in ``own`` as given."""
    time, level = pulse.fwhm_ps / FWHM_PS, pulse.code / CODE_MV
    factors = {"ps": time, "mv": level, "mv2": level**2}
    changed: dict[str, Any] = {}
    for field in fields(settings):
        if field.name not in own and (factor := factors.get(field.name.rpartition("_")[2])):
            value = getattr(settings, field.name)
            changed[field.name] = tuple(factor * x for x in value) if isinstance(value, tuple) else factor * value
    result: Settings = replace(settings, **changed, **own)
    return result
