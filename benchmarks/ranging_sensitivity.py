"""What each threshold of ranging does: all results again with it halved and doubled, on one seeded set of records.

The set has what a scan meets: echoes from 4 to 90 mV, one and eight sweeps, misfired shots, ringing, shapes that have
aged, two surfaces in the spot, pulses that touch, clipping, a reference at the very start, no echo, no pulse; whole
traces and windows. Errors count where the walk was calibrated; without a calibration they count from their mean.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, fields, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import ranging_sensitivity_worlds as worlds

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.line import NO_RANGE, Flag
from picoradar.instrument.ranging import (
    AveragingSettings,
    LearningSettings,
    PlanSettings,
    Ranges,
    RangingSettings,
    WalkSettings,
    WindowPlanner,
    WindowTraces,
    average_ranges,
    average_sweeps,
    estimate,
    estimate_windows,
    fit_walk,
    learn,
)
from picoradar.instrument.ranging.self_calibration import self_calibrate
from picoradar.instrument.ranging.settings import NoticingSettings

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "instrument"))
from conftest import HALF_LIGHT, SyntheticReceiver

RECEIVER = SyntheticReceiver()
TIMES = RECEIVER.times_ps
RECORDS = 60
FLAT = 0.01  # of a figure: less is noise of the set
LEVELS_MV = np.geomspace(10.0, 68.0, 8)


@dataclass(frozen=True)
class Outcome:
    """Share of records with a range, of those with any flag, rms error (mm), and further figures."""

    ranged: float
    flagged: float
    rms_mm: float
    other: tuple[float, ...] = ()
    labels: tuple[str, ...] = ()

    @classmethod
    def of(cls, found: list[tuple[Ranges, float]], *other: float, from_mean: bool = False) -> Outcome:
        """Sum up ranges with the true interval (ps) of each group; NaN: no errors are to be counted."""
        flags = np.concatenate([ranges.flags for ranges, _ in found])
        errors = []
        for ranges, true in found:
            error = ranges.range_mm - HALF_LIGHT * true
            clean = np.isfinite(error) & ((ranges.flags & ~np.uint16(Flag.WALK_EXTRAPOLATED)) == 0)
            errors.append(error[clean] - (error[clean].mean() if from_mean and clean.any() else 0.0))
        every = np.concatenate(errors)
        rms = float(np.sqrt(np.mean(every**2))) if every.size else float("nan")
        return cls(float(np.mean((flags & np.uint16(NO_RANGE)) == 0)), float(np.mean(flags != 0)), rms, other)

    def change(self, before: Outcome) -> str:
        """Say what is different by a hundredth and more, in figures; nothing when nothing is at all."""
        pairs = [("ranged", 100.0, "%"), ("flagged", 100.0, "%"), ("rms_mm", 1000.0, "um")]

        def shown(name: str, scale: float, unit: str) -> str:
            old, new = getattr(before, name), getattr(self, name)
            return f"{name.removesuffix('_mm')} {scale * old:.2f} -> {scale * new:.2f} {unit}"

        parts = [
            shown(name, scale, unit)
            for name, scale, unit in pairs
            if not np.isclose(getattr(self, name), getattr(before, name), rtol=FLAT, atol=0.0, equal_nan=True)
        ]
        parts += [
            f"{label} {a:.4g} -> {b:.4g}".lstrip()
            for a, b, label in zip(before.other, self.other, self.labels or [""] * len(self.other), strict=True)
            if not np.isclose(a, b, rtol=FLAT, atol=0.0)
        ]
        return ", ".join(parts) or ("" if str(self) == str(before) else "below 1 %")


@cache
def series() -> list[np.ndarray]:
    """A gray-target series, 40 records of each level."""
    return [
        RECEIVER.traces(TIMES, 4003.1, level, records=40, sweeps=8, seed=700 + k) for k, level in enumerate(LEVELS_MV)
    ]


@cache
def calibration() -> Calibration:
    return RECEIVER.calibrate(LEVELS_MV, records=60, sweeps=8)


@cache
def traces() -> list[tuple[np.ndarray, int, float]]:
    """Groups of whole traces with their sweeps and true interval."""
    rng = np.random.default_rng(41)
    groups = [
        (RECEIVER.traces(TIMES, 2500.0 + 300.0 * k, level, records=RECORDS, sweeps=sweeps, seed=k), sweeps)
        for k, (level, sweeps) in enumerate([(4, 1), (8, 1), (12, 8), (20, 1), (20, 8), (45, 1), (45, 8), (90, 8)])
    ]
    inside = [False, False, True, True, True, True, True, False]  # of the calibrated walk
    good = [(v, n, 2500.0 + 300.0 * k if inside[k] else float("nan")) for k, (v, n) in enumerate(groups)]
    plain = partial(RECEIVER.traces, TIMES, 4000.0, records=RECORDS)
    misfired = plain(45.0, sweeps=8, seed=30)
    at = np.searchsorted(TIMES, RECEIVER.reference_ps + 4000.0 + RECEIVER.half_ps(45.0))
    misfired[:, at : at + 2] -= misfired[:, at : at + 2] / 8
    light = TIMES - RECEIVER.reference_ps
    two = plain(30.0, sweeps=8, seed=31) + RECEIVER.pulse(light - 4250.0, 25.0)
    alone = rng.normal(0, 0.6, (RECORDS, TIMES.size)) + RECEIVER.pulse(light, 45.0)
    ringing = plain(45.0, sweeps=8, seed=35)
    for late in (0.0, 4000.0):
        ringing += 5.0 * np.exp(-(((light - late - 1100.0) / 90.0) ** 2))
    stretched = [
        RECEIVER.pulse((light - late) / 1.04, 45.0) - RECEIVER.pulse(light - late, 45.0) for late in (0.0, 4000.0)
    ]
    aged = plain(45.0, sweeps=8, seed=36) + sum(stretched)
    early = np.roll(plain(45.0, sweeps=8, seed=37), -81, axis=1)  # the pulse begins 60 ps after the first sample
    spike = alone.copy()
    spike[:, 900:920] += 30.0
    close = [RECEIVER.traces(TIMES, gap, 30.0, records=RECORDS, seed=int(gap)) for gap in (500.0, 900.0, 1300.0)]
    clipped = np.clip(plain(140.0, seed=32), -16.0, 111.5)
    short = RECEIVER.traces(TIMES[:70] + 600.0, 1e5, 1e-9, records=RECORDS, seed=33)
    padded = np.pad(short, ((0, 0), (0, TIMES.size - 70)))
    bad = [two, alone, spike, *close, clipped, rng.normal(0, 0.6, (RECORDS, TIMES.size)), padded]
    ageing = [(misfired, 8, 4000.0), (ringing, 8, 4000.0), (aged, 8, 4000.0), (early, 8, float("nan"))]
    return [*good, *ageing, *((values, 1, float("nan")) for values in bad)]


def whole(settings: RangingSettings, method: Any = "template", *, calibrated: bool = True) -> Outcome:
    use = calibration() if calibrated else None
    found = [
        (estimate(v, TIMES, method=method, calibration=use, sweeps=s, settings=settings), t) for v, s, t in traces()
    ]
    return Outcome.of(found, from_mean=not calibrated)


@cache
def windows() -> list[tuple[WindowTraces, WindowTraces, float]]:
    out = []
    for k, (step, samples, late, level) in enumerate(
        [(6.7, 96, -90.0, 45.0), (6.7, 96, -90.0, 4.0), (6.7, 96, 60.0, 45.0), (6.7, 96, -440.0, 45.0),
         (26.8, 140, -1500.0, 45.0), (10.0, 64, -90.0, 12.0), (6.7, 96, -90.0, 90.0), (20.1, 30, -90.0, 30.0)]
    ):  # fmt: skip
        pair = []
        for start in (RECEIVER.reference_ps - 90.0, RECEIVER.reference_ps + 4120.77 + late):
            times = start + step * np.arange(samples)
            values = RECEIVER.traces(times, 4120.77, level, records=RECORDS, seed=50 + k)
            values[::6, samples // 3] += 6.0
            drift = np.linspace(0.0, 2.0, RECORDS) if k == 0 else 0.0  # of both pulses, by a few of their deviations
            pair.append(WindowTraces.of(values, times[0] + drift, step))
        out.append((pair[0], pair[1], 4120.77 if level > 10.0 and level < 68.0 else float("nan")))
    return out


def windowed(settings: RangingSettings) -> Outcome:
    return Outcome.of(
        [
            (estimate_windows(r, e, calibration=calibration(), shared_reference=share, settings=settings), true)
            for r, e, true in windows()
            for share in (False, True)
        ]
    )


def everything(settings: RangingSettings) -> dict[str, Outcome]:
    return {
        "template": whole(settings),
        "half-maximum": whole(settings, "half-maximum"),
        "self-calibrated": whole(settings, calibrated=False),
        "windows": windowed(settings),
    }


def noticed(settings: RangingSettings) -> dict[str, Outcome]:
    return {world: Outcome(*worlds.noticed(world, settings), worlds.LABELS) for world in worlds.WORLDS}


def foreign(settings: RangingSettings) -> dict[str, Outcome]:
    return {"1 ns bins": Outcome(*worlds.foreign(settings))}


def learnt_elsewhere(learning: LearningSettings) -> dict[str, Outcome]:
    return {"1 ns bins": Outcome(*worlds.learnt(learning))}


def learnt(settings: LearningSettings) -> dict[str, Outcome]:
    templates, noise = learn(series(), TIMES, sweeps=8, learning=settings)
    using = calibration().model_copy(update={"templates": templates, "noise": noise})
    found = [(estimate(v, TIMES, calibration=using, sweeps=s), t) for v, s, t in traces()[:8]]
    values, counts = np.vstack(series()), np.full(len(series()) * 40, 8.0)
    alone = self_calibrate(values, TIMES, RangingSettings(), counts, settings)
    if alone is None:
        raise ValueError("no shapes could be learnt")
    using = calibration().model_copy(update={"templates": alone[0], "noise": alone[1], "walk": {}})
    ranges = [(estimate(v, TIMES, calibration=using, sweeps=8), 4003.1) for v in series()]
    return {
        "calibrated with it": Outcome.of(found, noise.floor_mv, noise.jitter_ps),
        "self-calibrated": Outcome.of(ranges, alone[1].floor_mv, from_mean=True),
    }


def walked(settings: WalkSettings) -> dict[str, Outcome]:
    bare = calibration().model_copy(update={"walk": {}})
    levels = []
    for k, values in enumerate(series()):
        found = estimate(values, TIMES, calibration=bare, sweeps=8)
        error = found.range_mm - HALF_LIGHT * 4003.1
        error[k % 3 :: 20] += 2.0  # wild readings
        levels.append((found.response_mv, error))
    walk = fit_walk(levels, settings=settings)
    at = np.geomspace(11.0, 60.0, 40)
    true = np.array([RECEIVER.range_mm(0.0, level) for level in at])
    off = walk.at(at).error_mm - true
    rms = float(np.sqrt(np.mean(off**2)))
    return {"walk": Outcome(1.0, 0.0, rms, (float(np.sqrt(np.mean((off / walk.at(at).sd_mm) ** 2))),))}


def averaged(settings: AveragingSettings) -> dict[str, Outcome]:
    rng = np.random.default_rng(8)
    sweeps = rng.normal(0, 0.6, (200, 8, 192)) + 45.0 * np.exp(-(((np.arange(192) - 90) / 30.0) ** 2))
    sweeps[:50, 3, 85] = 0.0
    ranges = 900.0 + rng.normal(0, 0.2, (400, 6))
    ranges[:40, 2] += 1.5
    found = (
        average_sweeps(sweeps, settings=settings),
        average_ranges(ranges, np.full((400, 6), 0.04), settings=settings),
    )
    rms = float(np.sqrt(np.mean((found[1].range_mm - 900.0) ** 2)))
    return {"averages": Outcome(1.0, float(found[0].left_out.mean()), rms, (float(found[1].left_out.mean()),))}


def planned(settings: PlanSettings) -> dict[str, Outcome]:
    """Shots of a line, of the next one, of a monitored point, of the zero mark, and of the line after a noisy one; and
    how many columns are taken again, also of the noisy one."""
    planner = WindowPlanner(calibration(), 20, settings)

    def shots() -> float:
        return float(sum(place.shots(settings.settle_shots) for place in planner.line()))

    first = shots()
    echo = RECEIVER.reference_ps + 4120.0 + 25.0 * np.arange(20)
    state = {"echo_ps": echo, "echo_before_ps": echo - 20.0, "reference_ps": (RECEIVER.reference_ps + 160.0, 20.0)}
    planner.load_state({**state, "response_mv": np.where(np.arange(20) == 7, 2.5, 30.0)})
    places, second = planner.line(), shots()
    watched = planner.monitor(float(echo[0]), 30.0).shots(settings.settle_shots)
    mark = planner.mark(750.0).shots(settings.settle_shots)
    blank = np.zeros(20)
    response = np.where(np.arange(20) == 12, 18.0, 30.0)
    seen = Ranges(blank, blank, response, np.zeros(20, np.uint16), blank, blank, blank, echo)
    again = float(len(planner.lost(places, seen)))
    unsure = float(len(planner.lost(places, replace(seen, variance_mm2=np.linspace(0.1, 1.3, 20) ** 2))))
    figures = (first, second, float(watched), float(mark), again, unsure, shots())
    return {"plan": Outcome(1.0, 0.0, 0.0, figures, PLANNED)}


PLANNED = ("first line", "next line", "monitored", "mark", "again", "again of a noisy line", "line after it")
NOTICING = tuple(field.name for field in fields(NoticingSettings))
ROOMS: tuple[tuple[Any, Any, tuple[str, ...]], ...] = (  # settings, what is done with them, thresholds (none: the rest)
    (RangingSettings.for_pulse(worlds.OTHER), foreign, worlds.FOREIGN),
    (RangingSettings(), noticed, NOTICING),
    (RangingSettings(), everything, ()),
    (LearningSettings.for_pulse(worlds.NARROW), learnt_elsewhere, ("peak_room_ps", "shape_step_ps", "coarsest_ps")),
    (LearningSettings(), learnt, ()),
    (WalkSettings(), walked, ()),
    (AveragingSettings(), averaged, ()),
    (PlanSettings(free_shots=96), planned, ("free_shots",)),
    (PlanSettings(), planned, ()),
)


def scaled(value: Any, factor: float) -> Any:
    """Give half or twice a value; of a tuple, of its numbers that are no counts; whole numbers stay whole and rise."""
    if isinstance(value, tuple):
        return tuple(v if isinstance(v, int) else scaled(v, factor) for v in value)
    if isinstance(value, int):
        return max(int(value * factor), 1)
    return value * factor


def sensitivity(only: str | None = None) -> None:
    """Print, for each threshold, what halving and doubling changes."""
    print("threshold | value | half of it | twice\n---|---|---|---")
    for settings, run, names in ROOMS:
        before: dict[str, Outcome] = {}
        elsewhere = [name for other, _, of in ROOMS if type(other) is type(settings) for name in of]
        for field in fields(settings):
            value = getattr(settings, field.name)
            here = field.name in names if names else field.name not in elsewhere
            if isinstance(value, bool) or (only and only not in field.name) or not here:
                continue
            before = before or run(settings)
            cells = []
            for factor in (0.5, 2.0):
                try:
                    after = run(replace(settings, **{field.name: scaled(value, factor)}))
                except Exception as error:  # noqa: BLE001  (a value that makes no sense is an answer, too)
                    cells.append(f"refused: {type(error).__name__}")
                    continue
                said = [f"{name}: {o.change(before[name])}" for name, o in after.items() if o.change(before[name])]
                cells.append("; ".join(said) or "nothing")
            print(f"`{type(settings).__name__}.{field.name}` | {value} | {cells[0]} | {cells[1]}", flush=True)
