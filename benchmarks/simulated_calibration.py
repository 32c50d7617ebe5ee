"""Measure the calibration that ships for the simulated bench, through the instrument's own scan path.

A plate stands square to the beam at 1 m; its reflectance is changed from black to white. At each level 400 places are
ranged, from which the walk against response and the range zero follow. Run it again when the receiver changes:

    .venv/bin/python benchmarks/simulated_calibration.py
"""

from __future__ import annotations

import datetime
import sys
import tempfile
from pathlib import Path

import numpy as np

from drivers.clock import VirtualClock
from instrument.calibration import Calibration, Walk
from instrument.controller import Controller
from instrument.devices import make_bench
from instrument.recording import Recording
from instrument.scan import RasterScan
from instrument.settings import Links, Settings, override
from sim import SimulatedBench

OUT = Path(__file__).parents[1] / "instrument" / "data" / "simulated-bench.json"
DISTANCE_MM = 1000.0
LEVELS = np.geomspace(0.9, 0.10, 16)
SEED = 20040101
WALK_FREE_MV = 35.0  # above, no walk is left that could be told from the noise


def main() -> None:
    rough = Calibration(
        date=datetime.datetime(2026, 11, 22, tzinfo=datetime.UTC),
        provenance="rough, for measuring the walk",
        mirror_separation_mm=30.0,
    )
    settings = override(Settings(), {"scan": {"rows": 20, "columns": 20, "step_mm": 1.0, "distance_mm": DISTANCE_MM}})
    found = np.array([measure(settings, rough, level, SEED + i) for i, level in enumerate(LEVELS)])
    response, error, sd = found[np.argsort(found[:, 0])].T
    zero = float(error[response > WALK_FREE_MV].mean())
    places = settings.scan.rows * settings.scan.columns
    calibration = rough.model_copy(
        update={
            "provenance": f"benchmarks/simulated_calibration.py: plate at {DISTANCE_MM:g} mm, "
            f"{LEVELS.size} levels x {places} places, seed {SEED}",
            "range_zero_mm": float(-zero),
            "walk": {"half-maximum": Walk(response_mv=tuple(response), error_mm=tuple(error - zero), sd_mm=tuple(sd))},
            "pointing_sd_rad": 3.8e-5,
        }
    )
    OUT.parent.mkdir(exist_ok=True)
    calibration.save(OUT)
    np.savetxt(
        sys.stdout, np.column_stack([response, error - zero, sd]), fmt="%8.3f", header="response_mv error_mm sd_mm"
    )


def measure(settings: Settings, calibration: Calibration, reflectance: float, seed: int) -> tuple[float, float, float]:
    """Return mean response (mV), mean range error (mm) and its standard error at one level."""
    clock = VirtualClock()
    with SimulatedBench(
        {"reflectance": reflectance, "distance_mm": DISTANCE_MM}, target="plate", seed=seed, clock=clock
    ) as sim:
        controller = Controller(make_bench(Links(**sim.urls), clock, sim.usb_backend), settings)
        identities = controller.connect()
        controller.warm_up()
        job = RasterScan(settings, calibration, clock)
        sampler = controller.bench.sampler
        with tempfile.TemporaryDirectory() as folder:
            header = job.header(identities, seed=seed, zero_code=sampler.zero_code, mv_per_code=sampler.mv_per_code)
            with Recording.create(Path(folder) / "level.db", header) as recording:
                controller.scan(job, recording)
                cloud = recording.cloud().with_range()
        controller.shut_down()
        true_mm = sim.truth.ranges_mm(cloud.rows.astype(np.int64) * settings.scan.columns + cloud.columns + 1)
        error = cloud.range_mm - true_mm
        return float(cloud.response_mv.mean()), float(error.mean()), float(error.std(ddof=1) / np.sqrt(error.size))


if __name__ == "__main__":
    main()
