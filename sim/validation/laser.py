"""Transmitter: figures 2.5 and 2.7 to 2.12, and the light budget."""

from __future__ import annotations

import numpy as np

from picoradar.sim.physics import LaserPulse, Transmitter
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.validation.figures import Check, Part, axes


def laser() -> Part:
    """Compare pulses of current and light with sections 2.3 and 2.6.1."""
    settings = SimulationSettings()
    transmitter = Transmitter(settings)
    slow, fast = transmitter.pulse(290.0, 23.0, 20e3), transmitter.pulse(290.0, 23.0, 80e3)
    volts = np.arange(240.0, 330.5, 1.0)
    degc = np.arange(17.0, 25.01, 0.05)
    by_volts = [transmitter.pulse(v, 23.0) for v in volts]
    by_degc = [transmitter.pulse(290.0, t) for t in degc]
    power_v, width_v, rise_v = _columns(by_volts)
    power_t, width_t, rise_t = _columns(by_degc)
    weak = transmitter.misfire(240.0, 4500.0)
    mean_mw = fast.energy_pj * 1e-9 * 80e3 * settings.exit_transmission
    by_degree = -np.diff([transmitter.pulse(290.0, t).fwhm_ps for t in np.arange(17.0, 25.5)])
    step = (volts >= 270) & (volts <= 290)

    checks = [
        Check("peak power at 290 V, 23 degC, 80 kHz (W, S 2.6.1)", "128.2", fast.peak_w, 126.2, 130.2),
        Check("peak power at 20 kHz (W, S 2.6.1)", "127.9", slow.peak_w, 125.9, 129.9),
        Check("FWHM of the laser pulse (ps, fig 2.5)", "44", fast.fwhm_ps, 42, 46),
        Check("rise time of the laser pulse (ps, S 2.3)", "32", fast.rise_ps, 30, 34),
        Check("FWHM at low injection (ps, fig 2.5)", "637", weak.fwhm_ps, 617, 657),
        Check("peak power at low injection (W, fig 2.5)", "a few", weak.peak_w, 1, 4),
        Check("emission after the trigger (ns, S 2.3)", "about 4.5", fast.delay_ps / 1e3, 4.3, 4.7),
        Check("mean optical power at the exit (mW, S 2.3)", "0.3", mean_mw, 0.28, 0.32),
        Check("peak power at 240 V (W, fig 2.8)", "small", power_v[0], 0, 10),
        Check("peak power at 330 V (W, fig 2.8)", "about 180", power_v[-1], 170, 190),
        Check("rise of peak power 270-290 V, share of 240-330 V (fig 2.8)", "large", _share(power_v, step), 0.5, 1),
        Check("fall of FWHM 270-290 V, share of 240-330 V (fig 2.9)", "abrupt", _share(width_v, step), 0.5, 1),
        Check("rise time at 250 V (ps, fig 2.10)", "80 at the most", float(rise_v[10]), 30, 85),
        Check("rise time at 330 V (ps, fig 2.10)", "30 or more", float(rise_v[-1]), 29.5, 32),
        Check("best temperature at 290 V (degC, fig 2.11)", "23", float(degc[power_t.argmax()]), 22.5, 23.5),
        Check("peak power at 25 degC over the best (fig 2.11)", "drops gradually", power_t[-1] / power_t.max(), 0.8, 1),
        Check("largest fall of FWHM from (degC, fig 2.12)", "20", float(17 + by_degree.argmax()), 20, 20),
        Check("FWHM falls all the way (least fall, ps/degC, fig 2.12)", "continuously", by_degree.min(), 0, 100),
    ]
    pictures = {}
    for prf_hz, peak, fwhm, rise in ((20e3, 19.64, 2.88, 2.41), (80e3, 19.72, 2.83, 2.39)):
        current = transmitter.current(290.0, 23.0, prf_hz)
        khz = f"{prf_hz / 1e3:.0f} kHz"
        checks += [
            Check(f"current peak at {khz} (A, fig 2.7)", f"{peak}", current.peak_a, peak - 0.05, peak + 0.05),
            Check(f"current FWHM at {khz} (ns, fig 2.7)", f"{fwhm}", current.fwhm_ns, fwhm - 0.05, fwhm + 0.05),
            Check(f"current rise time at {khz} (ns, fig 2.7)", f"{rise}", current.rise_ns, rise - 0.03, rise + 0.03),
        ]
    lag_ns = transmitter.current(290.0, 23.0, 80e3).delay_ns
    checks.append(Check("delay between the current pulses (ns, fig 2.7)", "0.2", lag_ns, 0.18, 0.22))

    figure, ax = axes("Time (ns)", "Optical power (W)", (22, 30), (0, 140))
    time_ns = np.linspace(22, 30, 4000)
    ax.plot(time_ns, _gauss(time_ns, 25.0, fast), label=f"high injection, FWHM {fast.fwhm_ps:.0f} ps")
    ax.plot([], [], "C1", label=f"low injection, FWHM {weak.fwhm_ps:.0f} ps (right axis)")
    right = ax.twinx()
    right.set_ylim(0, 3)
    right.plot(time_ns, _gauss(time_ns, 27.5, weak), "C1")
    ax.legend(loc="upper right", fontsize=8)
    pictures["fig_2_05"] = ("2.5: laser pulses at low and high injection", figure)

    figure, ax = axes("Time (ns)", "Current (A)", (0, 12), (0, 22))
    for prf_hz in (20e3, 80e3):
        current = transmitter.current(290.0, 23.0, prf_hz)
        time_ns = np.linspace(0, 12, 600)
        ax.plot(time_ns, [current.at(t - 5 - current.delay_ns) for t in time_ns], label=f"{prf_hz / 1e3:.0f} kHz")
    ax.legend()
    pictures["fig_2_07"] = ("2.7: current pulses at 20 and 80 kHz", figure)

    curves = (
        ("fig_2_08", "2.8: peak power against supply voltage", "Peak power (W)", (0, 200), power_v),
        ("fig_2_09", "2.9: FWHM against supply voltage", "FWHM (ps)", (30, 140), width_v),
        ("fig_2_10", "2.10: rise time against supply voltage", "Rise time (ps)", (30, 80), rise_v),
    )
    for stem, caption, label, limits, values in curves:
        figure, ax = axes("Supply voltage (V)", label, (240 if stem == "fig_2_08" else 250, 330), limits)
        ax.plot(volts, values)
        pictures[stem] = (caption, figure)
    figure, ax = axes("Temperature (degC)", "Peak power (W)", (17, 25), (0, 140))
    ax.plot(degc, power_t)
    pictures["fig_2_11"] = ("2.11: peak power against temperature", figure)
    figure, ax = axes("Temperature (degC)", "FWHM and rise time (ps)", (19, 25), (20, 120))
    ax.plot(degc, width_t, label="FWHM")
    ax.plot(degc, rise_t, label="rise time")
    ax.legend()
    pictures["fig_2_12"] = ("2.12: FWHM and rise time against temperature", figure)
    return Part(checks, pictures)


def _columns(pulses: list[LaserPulse]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    table = np.array([(pulse.peak_w, pulse.fwhm_ps, pulse.rise_ps) for pulse in pulses])
    return table[:, 0], table[:, 1], table[:, 2]


def _share(values: np.ndarray, part: np.ndarray) -> float:
    return float(np.ptp(values[part]) / np.ptp(values))


def _gauss(time_ns: np.ndarray, centre_ns: float, pulse: LaserPulse) -> np.ndarray:
    return np.asarray(pulse.peak_w * np.exp(-4 * np.log(2) * ((time_ns - centre_ns) * 1e3 / pulse.fwhm_ps) ** 2))
