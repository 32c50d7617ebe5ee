"""Records of the simulated radar in its two worlds, and of other instruments, for `ranging_sensitivity`.

What the ranging notices (docs/ranging.md) is in them: more jitter, hum and 1/f noise, lost triggers, misfires of the
diode, another pulse, and second surfaces 8 to 60 mm behind the first of a quarter of the records.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from ranging_foreign import PLAIN, Forest, Score, airborne
from ranging_radar import DISTANCE_MM, FloatArray, calibrate, readings

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.line import NO_RANGE, Flag
from picoradar.instrument.ranging import LearningSettings, OtherPulse, Ranges, RangingSettings, estimate
from picoradar.sim.validation import SWEEPS, TIMES_PS, Bench, painted

SEED = 5100
RECORDS = 60
WORLDS = ("dissertation", "clinic")
DISTURBED: tuple[tuple[float, dict[str, float]], ...] = (
    (45.0, {}),
    (15.0, {}),
    (40.0, {"trigger_jitter_ps": 10.0}),
    (40.0, {"hum_mv": 1.0}),
    (40.0, {"flicker_mv": 0.3}),
    (40.0, {"lost_trigger_share": 0.005}),
    (40.0, {"lost_trigger_share": 0.02}),
    (40.0, {"pickup_mv": 0.5}),
    (40.0, {"carrier_transit_ps": 730.0}),
    (40.0, {"ambient_degc": 21.5}),
)
SECOND_MM = (8.0, 13.0, 20.0, 60.0)
SECOND_SHARE = 4  # one in so many records has one
LEVELS = ((10.0, 1.0), (22.0, 1.0), (45.0, 1 / 3))  # response of the first echo (mV), and the last one over it


class Group(NamedTuple):
    """Traces (R, S), true ranges (R,) mm, true ranges of the last echo (NaN where there is one), and whether the radar
    is as it was calibrated, and the target a single surface."""

    traces: FloatArray
    true_mm: FloatArray
    last_mm: FloatArray
    usual: bool


@cache
def calibrated(world: str) -> Calibration:
    return calibrate(SEED, 60, world)


@cache
def groups(world: str) -> list[Group]:
    plate = {"target": "plate", "distance_mm": DISTANCE_MM, "world": world}
    made, doubles = [], RECORDS // SECOND_SHARE
    for k, (response, changes) in enumerate(DISTURBED):
        bench = painted(SEED, response, **plate, **changes)
        traces, true = readings(bench, RECORDS, SWEEPS, after=10_000 + RECORDS * k)
        made.append(Group(traces, true, np.full(RECORDS, np.nan), not changes))
    for k, (gap, (response, share)) in enumerate((g, level) for g in SECOND_MM for level in LEVELS):
        single, single_mm = readings(
            painted(SEED, 30.0, **plate), RECORDS - doubles, SWEEPS, after=20_000 + RECORDS * k
        )
        alone = painted(SEED, response, **plate).settings.reflectance
        bench = Bench(SEED, **plate, reflectance=alone, second_path_share=share, second_path_mm=gap)
        double, double_mm = readings(bench, doubles, SWEEPS, after=30_000 + RECORDS * k)
        last = np.concatenate([np.full(RECORDS - doubles, np.nan), double_mm + gap])
        made.append(Group(np.concatenate([single, double]), np.concatenate([single_mm, double_mm]), last, False))
    return made


class Figures(NamedTuple):
    """What the records of a world say of the settings."""

    ranged: float
    flagged: float
    rms_mm: float
    other: tuple[float, ...]


def noticed(world: str, settings: RangingSettings) -> Figures:
    """Return what a world's records say; errors are those of single surfaces without a flag, ``other`` has `LABELS`."""
    flags, error, stated, usual, second, last = [], [], [], [], [], []
    for group in groups(world):
        found: Ranges = estimate(
            group.traces, TIMES_PS, calibration=calibrated(world), sweeps=SWEEPS, settings=settings
        )
        flags.append(found.flags & ~np.uint16(Flag.LOW_RESPONSE | Flag.WALK_EXTRAPOLATED))
        error.append(found.range_mm - group.true_mm)
        stated.append(found.variance_mm2)
        usual.append(np.full(RECORDS, group.usual))
        second.append(np.isfinite(group.last_mm))
        last.append(found.last_range_mm - group.last_mm)
    flag, off, variance, ours, two, of_last = map(np.concatenate, (flags, error, stated, usual, second, last))
    clean = (flag == 0) & np.isfinite(off) & ~two
    resolved = np.isfinite(of_last)
    other = (
        np.mean((off**2 / variance)[clean]) if clean.any() else np.nan,
        np.mean(flag[ours] != 0),
        np.mean(flag[two] != 0),
        np.mean(resolved[two]),
        np.sqrt(np.mean(of_last[resolved] ** 2)) if resolved.any() else 0.0,
    )
    rms = np.sqrt(np.mean(off[clean] ** 2)) if clean.any() else np.nan
    ranged = np.mean((flag & np.uint16(NO_RANGE)) == 0)
    return Figures(float(ranged), float(np.mean(flag != 0)), float(rms), tuple(float(x) for x in other))


LABELS = ("error^2 / stated^2", "flagged as calibrated", "second flagged", "told apart", "rms of the last, mm")
OTHER = OtherPulse(fwhm_ps=10_000.0, step_ps=1000.0, full_scale=PLAIN.full_scale)
FOREIGN = ("fill_samples", "crossing_half_width_ps", "low_response_sd_ps")
"""What has no effect on the radar's own traces."""


@cache
def foreign_traces() -> tuple[FloatArray, FloatArray, FloatArray]:
    given = airborne(Forest(fwhm_ns=10.0, length_ns=240, further=0.0), PLAIN, 300, SEED)
    given.traces[::3, 200:] = np.nan
    return given.traces, given.times_ps, given.true_ps


def foreign(settings: RangingSettings) -> Figures:
    """Return share ranged and flagged of 1 ns bins, deviation (here ns, of all records), and records beyond 0.6 ns."""
    traces, times_ps, true_ps = foreign_traces()
    learning = LearningSettings.for_pulse(OTHER)
    score = Score.of(estimate(traces, times_ps, method="half-maximum", settings=settings, learning=learning), true_ps)
    return Figures(score.ranged, score.flagged, score.sd_ns, (float(score.far), float(score.unflagged)))


NARROW = OtherPulse(fwhm_ps=3000.0, step_ps=1000.0, full_scale=PLAIN.full_scale)


@cache
def narrow_traces() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Pulses of three samples; the first record has an echo in the tail of its reference."""
    given = airborne(Forest(fwhm_ns=3.0, length_ns=90, lowest=30.0, further=0.0), PLAIN, 200, SEED)
    given.traces[0] = np.maximum(given.traces[0], np.roll(given.traces[0], 6))
    return given.traces, given.times_ps, given.true_ps


def learnt(learning: LearningSettings) -> Figures:
    """Return the same of templates that are learnt from the records themselves."""
    traces, times_ps, true_ps = narrow_traces()
    settings = RangingSettings.for_pulse(NARROW)
    score = Score.of(estimate(traces, times_ps, settings=settings, learning=learning), true_ps)
    return Figures(score.ranged, score.flagged, score.sd_ns, (float(score.far), float(score.unflagged)))
