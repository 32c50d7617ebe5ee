"""Whole scans of a radar that is not as it was calibrated: what the ranging says of them, and whether it is true.

    python benchmarks/ranging_disturbed.py [--seed 301] [--scans 10] [--only NAME] [--size 40]

Window scans of hip and prism with the whole simulated bench, calibrated without the disturbance. A row of the table is
a disturbance and a target, over all scans: device time, rms and largest error of points without a doubtful flag, how
many of them are off by more than 1 mm, squared error over stated variance, shares of points flagged (of those motion),
and completeness: points with a range among the places where something returns an echo.
"""

from __future__ import annotations

import argparse

import numpy as np
from ranging_scans import Taken, scan

from picoradar.instrument.line import SUSPECT, Flag

DISTURBANCES: dict[str, dict[str, object]] = {
    "none": {},
    "jitter 10 ps": {"trigger_jitter_ps": 10.0},
    "lost triggers 1 %": {"lost_trigger_share": 0.01},
    "hum 0.3 mV": {"hum_mv": 0.3},
    "surgical, 30 % tissue": {"surgical": True, "tissue_share": 0.3},
}
BEYOND_MM = 1.0


def row(taken: list[Taken]) -> str:
    """Summarise the scans of one kind."""
    good = [one.good for one in taken]
    error = np.concatenate([(one.cloud.range_mm - one.true_mm)[g] for one, g in zip(taken, good, strict=True)])
    variance = np.concatenate([one.cloud.range_variance_mm2[g] for one, g in zip(taken, good, strict=True)])
    flags = np.concatenate([one.cloud.flags for one in taken])
    there = np.concatenate([np.isfinite(one.true_mm) for one in taken])
    ranged = np.concatenate([one.cloud.has_range for one in taken])
    chi2 = [
        float(np.mean(((t.cloud.range_mm - t.true_mm)[g]) ** 2 / t.cloud.range_variance_mm2[g]))
        for t, g in zip(taken, good, strict=True)
    ]
    device_s = np.median([one.result["device_time_s"] for one in taken])

    def share(flag: Flag) -> float:
        return float(100 * np.mean((flags & np.uint16(flag)) != 0))

    return (
        f"{device_s:7.2f} {np.sqrt(np.mean(error**2)):6.3f} {np.abs(error).max():6.2f} "
        f"{np.count_nonzero(np.abs(error) > BEYOND_MM):6d} {np.mean(error**2 / variance):6.2f} "
        f"{min(chi2):5.2f}-{max(chi2):4.2f} {share(SUSPECT):6.2f} {share(Flag.MIXED):6.2f} "
        f"{share(Flag.DISTORTED):6.2f} {share(Flag.MOTION):6.2f} {100 * np.mean(ranged[there]):7.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=301)
    parser.add_argument("--scans", type=int, default=10)
    parser.add_argument("--size", type=int, default=40)
    parser.add_argument("--only", default="")
    asked = parser.parse_args()
    print(
        f"{'disturbance':22} target  time s    rms    max >1mm   chi2  of scans   flag%  mixed dist'd motion complete%",
        flush=True,
    )
    for name, changes in DISTURBANCES.items():
        if asked.only not in name:
            continue
        for target in ("hip", "prism"):
            if "surgical" in name and target == "prism":
                continue
            taken = [
                scan(asked.seed + k, target, "window", asked.size, windows_too=False, **changes)
                for k in range(asked.scans)
            ]
            print(f"{name:22} {target:6} {row(taken)}", flush=True)


if __name__ == "__main__":
    main()
