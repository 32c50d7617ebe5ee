"""The laser's current pulse: peak, width, rise time and delay, measured across R_M as in section 2.6.1 (figure 2.7)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.procedures.station.light import Light

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

LEAST_A = 1.0  # a weaker pulse is taken for an input that is not wired
TOP_SHARE = 0.9  # samples above this share of the highest one show where the peak is
DISSERTATION = "19.64 A, 2.88 ns and 2.41 ns at 20 kHz, 19.72 A, 2.83 ns and 2.39 ns at 80 kHz, 0.2 ns apart"


class Current(NamedTuple):
    """One current pulse: rate of the triggers (Hz), peak (A), FWHM and rise time from 10 to 90 % (ns), half of its
    leading edge (ns after the trigger), and the trace: times (S,) in ns, current (S,) in A."""

    prf_hz: float
    peak_a: float
    fwhm_ns: float
    rise_ns: float
    half_ns: float
    times_ns: FloatArray
    trace_a: FloatArray


def measured_current(light: Light, prf_hz: float) -> Current | None:
    """Evaluate the trace of the current; None where there is none, or no pulse in it.

    The peak is that of a polynomial of third order through the samples near it; edges are read off by straight lines.
    """
    if light.current_a is None or light.current_times_ps is None:
        return None
    trace, times = light.current_a, light.current_times_ps * 1e-3
    if not np.isfinite(trace).all() or trace.max() < LEAST_A:
        return None
    top = trace > TOP_SHARE * trace.max()
    middle = float(times[top].mean())
    peak_a = float(np.polynomial.Polynomial.fit(times[top] - middle, trace[top], 3)(times[top] - middle).max())
    highest = int(np.argmax(trace))
    up, down = trace[: highest + 1], trace[highest:]
    if up.min() > 0.1 * peak_a or down.min() > 0.5 * peak_a:
        return None  # not the whole pulse is in the trace
    low, half, high = (_crossing(times[: highest + 1], up, share * peak_a) for share in (0.1, 0.5, 0.9))
    fall = _crossing(times[highest:][::-1], down[::-1], 0.5 * peak_a)
    return Current(prf_hz, peak_a, fall - half, high - low, half, times, trace)


def _crossing(times: FloatArray, values: FloatArray, level: float) -> float:
    """Time at which values that rise to their end pass a level for the last time."""
    below = int(np.flatnonzero(values < level)[-1])
    share = (level - values[below]) / (values[below + 1] - values[below])
    return float(times[below] + share * (times[below + 1] - times[below]))


def current_figures(found: Sequence[Current]) -> dict[str, float | int | str | bool | None]:
    """Get the figures of the report, by rate."""
    figures: dict[str, float | int | str | bool | None] = {}
    for pulse in found:
        at = f"at_{pulse.prf_hz / 1e3:g}_khz"
        figures[f"current_peak_a_{at}"] = pulse.peak_a
        figures[f"current_fwhm_ns_{at}"] = pulse.fwhm_ns
        figures[f"current_rise_ns_{at}"] = pulse.rise_ns
    figures["current_delay_ns"] = found[-1].half_ns - found[0].half_ns if len(found) == 2 else None
    return figures


def current_finding(found: Sequence[Current]) -> str:
    """Say what was found, beside the dissertation's figures."""
    if not found:
        return "The current pulse was not measured: no pulse at channel 3 of the oscilloscope (R_M, 50 to 1)."
    parts = [f"{p.peak_a:.2f} A, {p.fwhm_ns:.2f} ns and {p.rise_ns:.2f} ns at {p.prf_hz / 1e3:g} kHz" for p in found]
    apart = f", {found[-1].half_ns - found[0].half_ns:.2f} ns apart" if len(found) > 1 else ""
    return f"Current through R_M, its FWHM and rise time: {', '.join(parts)}{apart} (dissertation: {DISSERTATION})."


def draw_current(figure: Figure, found: Sequence[Current]) -> None:
    """Draw the pulses over each other, as figure 2.7."""
    axes = figure.subplots()
    for pulse in found:
        axes.plot(pulse.times_ns, pulse.trace_a, lw=1, label=f"{pulse.prf_hz / 1e3:g} kHz")
    axes.set(xlabel="time after the trigger, ns", ylabel="current, A")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
