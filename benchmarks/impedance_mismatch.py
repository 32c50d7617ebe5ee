"""What a matched input of the sampling bridge would change (dissertation, chapter 6: less noise, hence fewer averages).

    python benchmarks/impedance_mismatch.py [--readings 1000] [--seed 2004]

The share of the pulse that the bridge sends back is taken from 0 to 30 % (`mismatch_reflection`, 12 % as shipped), on
a plate at 1 m that is painted so that its response is 60 mV each time; 8 averages, half maximum. For each: noise of
the dark trace, steepest slope and overshoot of the pulse, rms of the range, and below which distance echo and
reference overlap.

The noise of amplifier and bridge is a parameter of its own and does not depend on the mismatch here: the simulator
cannot confirm what chapter 6 expects, it shows what the shape of the pulse alone does. Beside that stands the most that
a lossless matching network can bring: of the power, the share G^2 is sent back, so that the signal grows by
1 / sqrt(1 - G^2), and as many averages fewer give the same ratio of signal to noise.
"""

from __future__ import annotations

import argparse
import json
import math

import numpy as np

from picoradar.sim.validation import TIMES_PS, overlap_cm, painted

REFLECTIONS = (0.0, 0.06, 0.12, 0.2, 0.3)
DISTANCE_MM = 1000.0
RESPONSE_MV = 60.0
ECHO_FROM_PS = 9500.0
DARK_FROM_PS = 13_500.0


def measured(reflection: float, readings: int, seed: int) -> dict[str, float]:
    """Noise, pulse and range for one share that is sent back."""
    changes = {"target": "plate", "distance_mm": DISTANCE_MM, "mismatch_reflection": reflection, "drift_ps": 0.0}
    bench = painted(seed, RESPONSE_MV, **changes)
    traces = np.array([bench.take()[0] for _ in range(64)])
    echo = np.where(TIMES_PS > ECHO_FROM_PS, traces.mean(axis=0), 0.0)
    ranges_mm = np.array([bench.interval_mm()[0] for _ in range(readings)])
    return {
        "reflection": reflection,
        "dark_noise_of_8_averages_mv": round(float(traces[:, TIMES_PS > DARK_FROM_PS].std()), 4),
        "response_mv": round(float(echo.max()), 2),
        "steepest_mv_per_ps": round(float(np.diff(echo).max() / np.diff(TIMES_PS)[0]), 3),
        "overshoot_share": round(float(-echo.min() / echo.max()), 4),
        "range_rms_mm": round(float(ranges_mm.std(ddof=1)), 4),
        "relative_error_of_rms": round(1 / math.sqrt(2 * readings), 3),
        "overlap_below_cm": round(overlap_cm(seed, mismatch_reflection=reflection), 1),
        "most_signal_by_matching": round(1 / math.sqrt(1 - reflection**2), 4),
        "averages_needed_then": round(8 * (1 - reflection**2), 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--readings", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=2004)
    asked = parser.parse_args()
    rows = [measured(reflection, asked.readings, asked.seed) for reflection in REFLECTIONS]
    print(json.dumps({"shipped_reflection": 0.12, "rows": rows}, indent=2))


if __name__ == "__main__":
    main()
