"""Scanner and drift: beam position errors of section 2.6.2, and the attempt without a reference of section 2.5."""

from __future__ import annotations

import numpy as np

from picoradar.drivers.clock import VirtualClock
from picoradar.sim.physics import LIGHT_MM_PER_PS, MirrorPair, Noise, SlowDrift
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.validation.figures import Check, Part, axes

AT_MM = 1000.0
READ_AFTER_S = 2e-3  # when the servo has arrived
ATTEMPT_S = 18 * 60.0
FLYBACK_REASON = (
    "0.5 mm is the creep as the servo arrives; 2 ms later a third of it is gone. "
    "The dissertation does not say how long after the step it read its scale"
)


def scanning(seed: int) -> Part:
    """Compare the pointing of the scanner and the drift of the time base."""
    step_mm = _errors_mm(seed, np.tile([0.0, 1.0], 200).tolist())
    flyback_mm = _errors_mm(seed, np.repeat(np.tile([20.0, -20.0], 50), 30).tolist())[30::30]
    settings = SimulationSettings()
    drift = SlowDrift(Noise(seed), "sampler.drift", settings.drift_ps, settings.drift_time_s)
    times_s = np.arange(0.0, ATTEMPT_S, 5.0)
    without_mm = np.array([drift.at(t) - drift.at(0.0) for t in times_s]) * LIGHT_MM_PER_PS / 2
    with_mm = np.array([drift.at(t + 7e-3) - drift.at(t) for t in times_s]) * LIGHT_MM_PER_PS / 2
    once_mm, always_mm = float(np.abs(without_mm).max()), float(np.abs(with_mm).max())
    fly = "beam position at 40 mm of fly-back (mm at 1 m, mean after 2 ms, section 2.6.2)"
    checks = [
        Check(
            "beam position at 1 mm steps (mm at 1 m, 99 %, section 2.6.2)",
            "0.1",
            _bound(step_mm),
            0.07,
            0.13,
            "fitted",
        ),
        Check(fly, "0.5", _mean(flyback_mm), 0.3, 0.42, "known difference", FLYBACK_REASON),
        Check("drift in 18 min, reference taken once (mm, section 2.5)", "too much", once_mm, 1, 20, "fitted"),
        Check("drift between reference and echo (largest, mm)", "cancels", always_mm, 0, 0.01, "put in"),
    ]
    figure, ax = axes("Time (min)", "Range error (mm)", (0, 18), (-4, 4))
    ax.plot(times_s / 60, without_mm, label="reference measured once")
    ax.plot(times_s / 60, with_mm, label="reference in every record")
    ax.legend()
    return Part(checks, {"drift": ("section 2.5: why the attempt without a reference failed", figure)})


def _errors_mm(seed: int, places_mm: list[float]) -> np.ndarray:
    """Error of the beam at 1 m, shortly after each step."""
    settings, clock = SimulationSettings(), VirtualClock()
    mirrors = MirrorPair(clock, settings, Noise(seed))
    per_command_mm = AT_MM * np.radians(settings.field_deg / 2)
    errors = []
    for number, place in enumerate(places_mm):
        mirrors.command(place / per_command_mm, 0.0)
        clock.sleep(READ_AFTER_S)
        errors.append(mirrors.angles_rad(clock.now(), number)[0] * AT_MM - place)
    return np.array(errors)


def _bound(errors: np.ndarray) -> float:
    return float(np.percentile(np.abs(errors), 99))


def _mean(errors: np.ndarray) -> float:
    return float(np.abs(errors).mean())
