"""Transmitter: figures 2.5 and 2.7 to 2.12, and the light budget."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from picoradar.sim.physics import FloatArray, LaserPulse, Transmitter
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.validation.figures import Check, Kind, Part, axes

POWER_REASON = (
    "the model's power follows the current with a slope of 2.7, the measured one with 0.6, within the "
    "repeatability of a power meter; the energy noise of the shots (1.2 %) follows from the model's slope"
)
CURRENT_REASON = (
    "the model keeps the charge of the capacitor, so that peak and width change by the same 0.4 %; "
    "the stated peaks and widths make 1.3 % less charge at 80 kHz"
)
VOLTS = np.arange(240.0, 330.5, 1.0)
DEGC = np.arange(17.0, 25.01, 0.05)
CURRENT_PULSES = ((20e3, 19.64, 2.88, 2.41), (80e3, 19.72, 2.83, 2.39))  # rate, peak, FWHM and rise time of figure 2.7


def laser() -> Part:
    """Compare pulses of current and light with sections 2.3 and 2.6.1."""
    settings = SimulationSettings()
    transmitter = Transmitter(settings)
    by_volts = _columns([transmitter.pulse(v, 23.0) for v in VOLTS])
    by_degc = _columns([transmitter.pulse(290.0, t) for t in DEGC])
    checks = [
        *_pulse_checks(transmitter, settings.exit_transmission),
        *_voltage_checks(*by_volts),
        *_temperature_checks(transmitter, by_degc[0]),
        *_current_checks(transmitter),
    ]
    pictures = {
        "fig_2_05": ("2.5: laser pulses at low and high injection", _pulse_picture(transmitter)),
        "fig_2_07": ("2.7: current pulses at 20 and 80 kHz", _current_picture(transmitter)),
        **_voltage_pictures(*by_volts),
        **_temperature_pictures(*by_degc),
    }
    return Part(checks, pictures)


def _pulse_checks(transmitter: Transmitter, exit_transmission: float) -> list[Check]:
    slow, fast = transmitter.pulse(290.0, 23.0, 20e3), transmitter.pulse(290.0, 23.0, 80e3)
    weak = transmitter.misfire(240.0, 4500.0)
    mean_mw = fast.energy_pj * 1e-9 * 80e3 * exit_transmission
    return [
        Check("peak power at 290 V, 23 degC, 80 kHz (W, section 2.6.1)", "128.2", fast.peak_w, 126.2, 130.2, "fitted"),
        Check(
            "peak power at 80 kHz less that at 20 kHz (W, section 2.6.1)",
            "0.3",
            fast.peak_w - slow.peak_w,
            1.2,
            1.6,
            "known difference",
            POWER_REASON,
        ),
        Check("FWHM of the laser pulse (ps, fig 2.5)", "44", fast.fwhm_ps, 42, 46, "fitted"),
        Check("rise time of the laser pulse (ps, section 2.3)", "32", fast.rise_ps, 30, 34, "predicted"),
        Check("FWHM at low injection (ps, fig 2.5)", "637", weak.fwhm_ps, 617, 657, "put in"),
        Check("peak power at low injection (W, fig 2.5)", "a few", weak.peak_w, 1, 4, "put in"),
        Check("emission after the trigger (ns, section 2.3)", "about 4.5", fast.delay_ps / 1e3, 4.3, 4.7, "put in"),
        Check("mean optical power at the exit (mW, section 2.3)", "0.3", mean_mw, 0.28, 0.32, "fitted"),
    ]


def _voltage_checks(power_w: FloatArray, width_ps: FloatArray, rise_ps: FloatArray) -> list[Check]:
    step = (VOLTS >= 270) & (VOLTS <= 290)
    rise_share, fall_share = _share(power_w, step), _share(width_ps, step)
    return [
        Check("peak power at 240 V (W, fig 2.8)", "small", power_w[0], 0, 10, "fitted"),
        Check("peak power at 330 V (W, fig 2.8)", "about 180", power_w[-1], 170, 190, "fitted"),
        Check("rise of peak power 270-290 V, share of 240-330 V (fig 2.8)", "large", rise_share, 0.5, 1, "fitted"),
        Check("fall of FWHM 270-290 V, share of 240-330 V (fig 2.9)", "abrupt", fall_share, 0.5, 1, "fitted"),
        Check("rise time at 250 V (ps, fig 2.10)", "80 at the most", float(rise_ps[10]), 30, 85, "fitted"),
        Check("rise time at 330 V (ps, fig 2.10)", "30 or more", float(rise_ps[-1]), 29.5, 32, "fitted"),
    ]


def _temperature_checks(transmitter: Transmitter, power_w: FloatArray) -> list[Check]:
    best_degc, drop = float(DEGC[power_w.argmax()]), power_w[-1] / power_w.max()
    by_degree = -np.diff([transmitter.pulse(290.0, t).fwhm_ps for t in np.arange(17.0, 25.5)])
    largest_at = float(17 + by_degree.argmax())
    return [
        Check("best temperature at 290 V (degC, fig 2.11)", "23", best_degc, 22.5, 23.5, "fitted"),
        Check("peak power at 25 degC over the best (fig 2.11)", "drops gradually", drop, 0.8, 0.995, "fitted"),
        Check("largest fall of FWHM from (degC, fig 2.12)", "20", largest_at, 20, 20, "fitted"),
        Check(
            "smallest fall of FWHM (ps/degC, fig 2.12)", "falls continuously", by_degree.min(), 0.01, 100, "predicted"
        ),
    ]


def _current_checks(transmitter: Transmitter) -> list[Check]:
    slow, fast = (transmitter.current(290.0, 23.0, prf_hz) for prf_hz, *_ in CURRENT_PULSES)
    narrower_ns, sooner_ns = slow.fwhm_ns - fast.fwhm_ns, slow.rise_ns - fast.rise_ns
    other: tuple[Kind, str] = ("known difference", CURRENT_REASON)
    return [
        Check("current peak at 20 kHz (A, fig 2.7)", "19.64", slow.peak_a, 19.61, 19.67, "fitted"),
        Check("current peak at 80 kHz (A, fig 2.7)", "19.72", fast.peak_a, 19.69, 19.75, "fitted"),
        Check("current FWHM at 80 kHz (ns, fig 2.7)", "2.83", fast.fwhm_ns, 2.81, 2.85, "fitted"),
        Check("current rise time at 80 kHz (ns, fig 2.7)", "2.39", fast.rise_ns, 2.38, 2.4, "put in"),
        Check("current FWHM at 20 kHz less that at 80 kHz (ns, fig 2.7)", "0.05", narrower_ns, 0.010, 0.013, *other),
        Check("current rise at 20 kHz less that at 80 kHz (ns, fig 2.7)", "0.02", sooner_ns, 0.008, 0.012, *other),
        Check("delay between the current pulses (ns, fig 2.7)", "0.2", fast.delay_ns, 0.18, 0.22, "put in"),
    ]


def _pulse_picture(transmitter: Transmitter) -> Figure:
    fast, weak = transmitter.pulse(290.0, 23.0, 80e3), transmitter.misfire(240.0, 4500.0)
    figure, ax = axes("Time (ns)", "Optical power (W)", (22, 30), (0, 140))
    time_ns = np.linspace(22, 30, 4000)
    ax.plot(time_ns, _gauss(time_ns, 25.0, fast), label=f"high injection, FWHM {fast.fwhm_ps:.0f} ps")
    ax.plot([], [], "C1", label=f"low injection, FWHM {weak.fwhm_ps:.0f} ps (right axis)")
    right = ax.twinx()
    right.set_ylim(0, 3)
    right.plot(time_ns, _gauss(time_ns, 27.5, weak), "C1")
    ax.legend(loc="upper right", fontsize=8)
    return figure


def _current_picture(transmitter: Transmitter) -> Figure:
    figure, ax = axes("Time (ns)", "Current (A)", (0, 12), (0, 22))
    for prf_hz, *_ in CURRENT_PULSES:
        current = transmitter.current(290.0, 23.0, prf_hz)
        time_ns = np.linspace(0, 12, 600)
        ax.plot(time_ns, [current.at(t - 5 - current.delay_ns) for t in time_ns], label=f"{prf_hz / 1e3:.0f} kHz")
    ax.legend()
    return figure


def _voltage_pictures(power_w: FloatArray, width_ps: FloatArray, rise_ps: FloatArray) -> dict[str, tuple[str, Figure]]:
    pictures = {}
    for stem, caption, label, limits, values in (
        ("fig_2_08", "2.8: peak power against supply voltage", "Peak power (W)", (0, 200), power_w),
        ("fig_2_09", "2.9: FWHM against supply voltage", "FWHM (ps)", (30, 140), width_ps),
        ("fig_2_10", "2.10: rise time against supply voltage", "Rise time (ps)", (30, 80), rise_ps),
    ):
        figure, ax = axes("Supply voltage (V)", label, (240 if stem == "fig_2_08" else 250, 330), limits)
        ax.plot(VOLTS, values)
        pictures[stem] = (caption, figure)
    return pictures


def _temperature_pictures(
    power_w: FloatArray, width_ps: FloatArray, rise_ps: FloatArray
) -> dict[str, tuple[str, Figure]]:
    power, ax = axes("Temperature (degC)", "Peak power (W)", (17, 25), (0, 140))
    ax.plot(DEGC, power_w)
    times, ax = axes("Temperature (degC)", "FWHM and rise time (ps)", (19, 25), (20, 120))
    ax.plot(DEGC, width_ps, label="FWHM")
    ax.plot(DEGC, rise_ps, label="rise time")
    ax.legend()
    return {
        "fig_2_11": ("2.11: peak power against temperature", power),
        "fig_2_12": ("2.12: FWHM and rise time against temperature", times),
    }


def _columns(pulses: list[LaserPulse]) -> tuple[FloatArray, FloatArray, FloatArray]:
    table = np.array([(pulse.peak_w, pulse.fwhm_ps, pulse.rise_ps) for pulse in pulses])
    return table[:, 0], table[:, 1], table[:, 2]


def _share(values: FloatArray, part: NDArray[np.bool_]) -> float:
    return float(np.ptp(values[part]) / np.ptp(values))


def _gauss(time_ns: FloatArray, centre_ns: float, pulse: LaserPulse) -> FloatArray:
    return np.asarray(pulse.peak_w * np.exp(-4 * np.log(2) * ((time_ns - centre_ns) * 1e3 / pulse.fwhm_ps) ** 2))
