"""Pull a cable in every line of a 40 x 40 scan and plug it in again: the scan completes, and no point is wrong.

python -m benchmarks.faults.cables            each link in turn, 5 scans
python -m benchmarks.faults.cables --rows 8 --columns 6
"""

from __future__ import annotations

import argparse
import io
import logging
import sys
import tempfile
from pathlib import Path

import numpy as np

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.traces import CodeScale
from picoradar.instrument import events
from picoradar.instrument.acquisition import Setup, raster_scan, sweep_of
from picoradar.instrument.bench import make_bench
from picoradar.instrument.cli.session import calibration_of
from picoradar.instrument.controller import Controller
from picoradar.instrument.line import NO_RANGE, SUSPECT, ScanLine
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Links, Settings, override
from picoradar.sim import SimulatedBench
from picoradar.sim.faults import Fault, arm

PULLS = {
    "dg645": "unplugged",
    "genesys": "unplugged",
    "tec": "unplugged",
    "helios": "usb_unplugged",
    "bridge": "usb_unplugged",
}
WRONG_MM = 2.0


def pull(link: str, rows: int, columns: int, folder: Path, away_s: float = 1.0, seed: int = 1) -> dict[str, float]:
    """Scan with one pull of a cable in each line but the first, at a random place of it.

    Returns
    -------
    dict
        ``lines`` stored, ``waits`` of the scan, ``wrong`` points marked good, ``verified`` whether the laser was off.
    """
    settings = override(Settings(), {"scan": {"rows": rows, "columns": columns}})
    clock, rng = VirtualClock(), np.random.default_rng(seed)
    sim = SimulatedBench({"target": "hip"}, seed=seed, clock=clock)
    controller = Controller(make_bench(Links(**sim.urls), clock, sim.usb_backend), settings)
    job = raster_scan(Setup(settings, calibration_of(settings), clock))
    line_s = columns * sweep_of(settings).record_s

    def sink(_line: ScanLine) -> None:
        at = {"time_s": clock.now() + float(rng.uniform(0, line_s))}
        arm(sim, [Fault.model_validate({"kind": PULLS[link], "link": link, "at": at, "lasts_s": away_s})])

    controller.connect()
    controller.warm_up()
    path = folder / f"{link}.db"
    with Recording.create(path, job.header({}, seed=seed, scale=CodeScale(32.0, 0.5))) as recording:
        outcome = controller.scan(job, recording, [sink])
    controller.shut_down()
    with Recording.open(path) as recording:
        cloud = recording.cloud()
    truth = {key[0]: seen.point_mm for key, seen in sim.optics.truth.items()}
    true_mm = np.array([truth[int(place)] for place in cloud.rows.astype(int) * columns + cloud.columns + 1])
    good = (cloud.flags & np.uint16(SUSPECT | NO_RANGE)) == 0
    wrong = int((np.linalg.norm(cloud.points_mm - true_mm, axis=1)[good] > WRONG_MM).sum())
    sim.close()
    waits = len(outcome.suspended)
    return {"lines": outcome.lines, "waits": waits, "wrong": wrong, "verified": outcome.safe.laser_off_verified}


def main() -> int:
    """Pull every cable."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=40)
    parser.add_argument("--columns", type=int, default=40)
    chosen = parser.parse_args()
    events.configure(logging.CRITICAL, io.StringIO())
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for link in PULLS:
            found = pull(link, chosen.rows, chosen.columns, Path(folder))
            sound = found["lines"] == chosen.rows and not found["wrong"] and found["verified"]
            failed += not sound
            print(f"{link}: {found}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
