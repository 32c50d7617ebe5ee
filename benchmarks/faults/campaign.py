"""Fault campaign: every kind of fault at every state, three seeds; writes docs/fault-campaign.md.

python -m benchmarks.faults.campaign            all cases
python -m benchmarks.faults.campaign --fast     each kind once, with the laser on
python -m benchmarks.faults.campaign --kind mirror_stuck --verbose
"""

from __future__ import annotations

import argparse
import io
import logging
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from benchmarks.faults.cases import Case, all_cases, selection
from benchmarks.faults.life import run
from benchmarks.faults.result import Result
from benchmarks.faults.table import markdown
from picoradar.instrument import events

PAGE = Path(__file__).parents[2] / "docs" / "fault-campaign.md"


def _run(case: Case) -> Result:
    events.configure(logging.CRITICAL, io.StringIO())
    with tempfile.TemporaryDirectory() as folder:
        return run(case, Path(folder))


def carry_out(cases: Sequence[Case], workers: int) -> Iterator[Result]:
    """Run the cases in some processes, in their order."""
    if workers == 1:
        yield from map(_run, cases)
        return
    with ProcessPoolExecutor(workers) as pool:
        yield from pool.map(_run, cases, chunksize=8)


def main() -> int:
    """Run the campaign and say what failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fast", action="store_true")
    parser.add_argument("--kind")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--page", type=Path, help="where to write the table (default: docs, for the full campaign)")
    chosen = parser.parse_args()
    cases = [c for c in (selection() if chosen.fast else all_cases()) if chosen.kind in (None, c.kind)]
    began = time.perf_counter()
    results = []
    for result in carry_out(cases, chosen.workers):
        results.append(result)
        if chosen.verbose or not result.passed:
            print(_line(result), flush=True)
    failed = [result for result in results if not result.passed]
    print(f"{len(results)} runs in {time.perf_counter() - began:.0f} s, {len(failed)} failed")
    page = chosen.page or (PAGE if not chosen.fast and chosen.kind is None else None)
    if page is not None:
        page.write_text(markdown(results), encoding="utf-8")
        print(f"written: {page}")
    return 1 if failed else 0


def _line(r: Result) -> str:
    times = "/".join("-" if t is None else f"{t * 1e3:.0f} ms" for t in (r.fault_to_dark_s, r.seen_to_dark_s))
    verdict = "ok" if r.passed else "FAILED" + ("" if r.safe else " UNSAFE") + ("" if r.in_time else " LATE")
    return (
        f"{verdict} {r.case}: {r.state}, {r.lines} lines, {r.suspensions} waits, {r.device_s:.0f} s, dark {times}, "
        f"lost {r.lost}, wrong {r.wrong}, off {r.off_verified}, lit {r.lit} {r.cause[:140]} {r.defect}"
    )


if __name__ == "__main__":
    sys.exit(main())
