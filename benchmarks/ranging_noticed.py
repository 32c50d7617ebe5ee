"""Single traces of a radar that is not as it was calibrated, and of two surfaces: is what the ranging states true?

    python benchmarks/ranging_noticed.py disturbed [--seed 77] [--readings 200]
    python benchmarks/ranging_noticed.py echoes    [--seed 78] [--readings 1000]

The calibration is measured on the undisturbed radar (12 gray levels), then a plate at 1 m is read with the disturbance.
"disturbed" prints deviation and bias, and the squared error over the stated variance of all readings and of those
without a flag. "echoes" puts a second surface behind the plate: both ranges, and readings that are off by more than
three stated deviations without a flag. Its readings are judged among as many single echoes as there are two, so that
nothing that all of them have in common gives them away.
"""

from __future__ import annotations

import argparse

import numpy as np
from ranging_radar import DISTANCE_MM, FloatArray, calibrate, readings

from picoradar.instrument.line import Flag
from picoradar.instrument.ranging import Ranges, estimate
from picoradar.sim.validation import TIMES_PS, Bench, painted

SWEEPS = 8
DISTURBED: tuple[tuple[str, int, dict[str, object]], ...] = (
    ("none", 8, {}),
    ("none", 1, {}),
    ("hum 0.3 mV", 8, {"hum_mv": 0.3}),
    ("hum 0.3 mV", 1, {"hum_mv": 0.3}),
    ("hum 1.0 mV", 8, {"hum_mv": 1.0}),
    ("1/f 0.1 mV", 8, {"flicker_mv": 0.1}),
    ("1/f 0.3 mV", 8, {"flicker_mv": 0.3}),
    ("pick-up 1 GHz 0.2 mV", 8, {"pickup_mv": 0.2}),
    ("pick-up 1 GHz 0.5 mV", 8, {"pickup_mv": 0.5}),
    ("jitter 5 ps", 8, {"trigger_jitter_ps": 5.0}),
    ("jitter 10 ps", 8, {"trigger_jitter_ps": 10.0}),
    ("jitter 20 ps", 8, {"trigger_jitter_ps": 20.0}),
    ("jitter 40 ps", 8, {"trigger_jitter_ps": 40.0}),
    ("lost triggers 0.5 %", 8, {"lost_trigger_share": 0.005}),
    ("lost triggers 2 %", 8, {"lost_trigger_share": 0.02}),
    ("lost triggers 0.5 %", 1, {"lost_trigger_share": 0.005}),
    ("lost triggers 2 %", 1, {"lost_trigger_share": 0.02}),
    ("second path 5 % at 20 mm", 8, {"second_path_share": 0.05, "second_path_mm": 20.0}),
    ("second path 10 % at 20 mm", 8, {"second_path_share": 0.10, "second_path_mm": 20.0}),
    ("second path 10 % at 40 mm", 8, {"second_path_share": 0.10, "second_path_mm": 40.0}),
    ("second path 5 % at 80 mm", 8, {"second_path_share": 0.05, "second_path_mm": 80.0}),
    ("detector rise +5 %", 8, {"photodiode_rise_ps": 189.0}),
    ("mismatch 0.15", 8, {"mismatch_reflection": 0.15}),
    ("bridge rise +5 %", 8, {"bridge_rise_ps": 174.3}),
    ("carrier transit +5 %", 8, {"carrier_transit_ps": 730.0}),
    ("diode 21 degC", 8, {"ambient_degc": 21.0}),
    ("diode 22 degC", 8, {"ambient_degc": 22.0}),
    ("diode 25 degC", 8, {"ambient_degc": 25.0}),
    ("drive 285 V", 8, {"drive_v": 285.0}),
    ("drive 295 V", 8, {"drive_v": 295.0}),
)
RESPONSE_MV = 40.0  # a diode at 21 degC gives no more with a white plate
GAPS_MM = (5.0, 8.0, 10.0, 15.0, 20.0, 30.0, 60.0, 120.0)
LEVELS = ((15.0, 1.0), (22.0, 1.0), (45.0, 1 / 3))  # response (mV) of the first echo, and the last one over it


def flags_of(found: Ranges) -> str:
    """Name the flags, with the share of readings."""
    shares = {flag: np.mean((found.flags & np.uint16(flag)) != 0) for flag in Flag}
    return ", ".join(f"{flag.words} {100 * share:.1f} %" for flag, share in shares.items() if share > 0)


def disturbed(seed: int, count: int) -> None:
    """Print a row for each disturbance."""
    calibration = calibrate(1000 * seed)
    print(f"{'disturbance':26} avg |  sd mm  bias mm stated | err^2/stated^2  of unflagged | flags")
    for name, sweeps, settings in DISTURBED:
        changes = {key: value for key, value in settings.items() if key != "drive_v"}
        bench = painted(seed, RESPONSE_MV, target="plate", distance_mm=DISTANCE_MM, **changes)
        if "drive_v" in settings:
            bench.supply.output_v = lambda volts=settings["drive_v"]: volts
        traces, true_mm = readings(bench, count, sweeps)
        found = estimate(traces, TIMES_PS, calibration=calibration, sweeps=sweeps)
        error = found.range_mm - true_mm
        there, sure = np.isfinite(error), found.flags == 0
        square = error**2 / found.variance_mm2
        of_sure = f"{np.mean(square[sure]):12.2f}" if np.mean(sure) > 0.05 else " " * 11 + "-"
        print(
            f"{name:26} {sweeps:3d} | {np.std(error[there]):6.3f} {np.mean(error[there]):8.3f} "
            f"{np.sqrt(np.median(found.variance_mm2[there])):6.3f} | {np.mean(square[there]):14.2f} {of_sure} "
            f"| {flags_of(found)}",
            flush=True,
        )


def two_surfaces(seed: int, count: int, gap_mm: float, first_mv: float, share: float) -> tuple[FloatArray, FloatArray]:
    """Take readings of a plate whose echo alone has a response, with a share of it again behind it."""
    level = painted(seed, first_mv, target="plate", distance_mm=DISTANCE_MM).settings.reflectance
    second = {"second_path_share": share, "second_path_mm": gap_mm}
    return readings(Bench(seed, target="plate", distance_mm=DISTANCE_MM, reflectance=level, **second), count, SWEEPS)


def echoes(seed: int, count: int) -> None:
    """Print a row for each pair of echoes."""
    calibration = calibrate(1000 * seed)
    half = "bias     sd  err^2/stated^2"
    print(f" gap mm   mV     |  first: {half} |  last: {half} | two %  flagged %  unflagged > 3 sd")
    pairs = [(gap_mm, *level) for gap_mm in GAPS_MM for level in LEVELS]
    single, _ = two_surfaces(seed + 1, count, 0.0, 30.0, 0.0)
    for gap_mm, first_mv, share in ((0.0, 45.0, 0.0), (0.0, 15.0, 0.0), *pairs):
        traces, true_mm = two_surfaces(seed, count, gap_mm, first_mv, share)
        mixed = np.empty((2 * count, traces.shape[1]))
        mixed[::2], mixed[1::2] = traces, single
        found = estimate(mixed, TIMES_PS, calibration=calibration, sweeps=SWEEPS).taken(np.arange(0, 2 * count, 2))
        first, last = found.range_mm - true_mm, found.last_range_mm - true_mm - gap_mm
        square, of_last = first**2 / found.variance_mm2, last**2 / found.last_variance_mm2
        flagged = (found.flags & ~np.uint16(Flag.LOW_RESPONSE | Flag.WALK_EXTRAPOLATED)) != 0
        two = np.isfinite(last)
        seen = f"{'-':>30}"
        if two.any():
            seen = f"{np.mean(last[two]):8.3f} {np.std(last[two]):6.3f} {np.mean(of_last[two]):14.2f}"
        print(
            f"{gap_mm:6.0f} {first_mv:4.0f}+{share * first_mv:2.0f} | "
            f"{np.mean(first):12.3f} {np.std(first):6.3f} {np.mean(square):14.2f}  | {seen}  | "
            f"{100 * np.mean(two):5.1f} {100 * np.mean(flagged):8.2f} {np.count_nonzero((square > 9) & ~flagged):8d}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("disturbed", "echoes"))
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--readings", type=int, default=200)
    asked = parser.parse_args()
    (disturbed if asked.what == "disturbed" else echoes)(asked.seed, asked.readings)


if __name__ == "__main__":
    main()
