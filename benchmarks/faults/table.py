"""The result of the campaign as a page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from benchmarks.faults.cases import HOST_KINDS
from benchmarks.faults.result import Result
from picoradar.instrument.controller import STATES
from picoradar.sim.faults import KINDS

HEAD = """# Fault campaign

Written by `python -m benchmarks.faults.campaign`. Every kind of fault is injected into a running bench in each state of
the controller, with three seeds; link and duration (2 s, 20 s, once or permanent) vary from run to run. Each run
continues to its end: connect, warm up, a scan of 4 x 4 points, with the recovery or safe shutdown that the
controller chooses.

* **dark after fault**: longest time from the first effect of the fault to the end of the light, measured by the bench.
* **dark after seen**: longest time from the moment at which a driver's call reported the fault to the end of the light.
* **lost**: acknowledged lines that cannot be read. **wrong**: points marked good, but more than 2 mm and 6 of their own
  standard deviations from the truth.
* **unsafe**: runs that ended with light, or with the laser not verified off.
* **hung**: runs without an end, or with an unexpected kind of error.
"""


def markdown(results: Sequence[Result]) -> str:
    """Write the page."""
    kinds = list(dict.fromkeys(r.case.kind for r in results))
    failed = sum(not r.passed for r in results)
    seen = [r.seen_to_dark_s for r in results if r.seen_to_dark_s is not None and r.case.kind != "host_dead"]
    dead = [r.fault_to_dark_s for r in results if r.case.kind == "host_dead" and r.fault_to_dark_s is not None]
    summary = [
        "",
        f"{len(results)} runs: {len(kinds)} kinds x {len(STATES)} states x 3 seeds; {failed} failed. "
        f"Acknowledged lines lost: {sum(r.lost for r in results)}. "
        f"Wrong points marked good: {sum(r.wrong for r in results)}. "
        f"Longest dark after seen: {max(seen, default=0.0) * 1e3:.1f} ms. "
        f"Longest dark after the death of the host: {max(dead, default=0.0):.3f} s. "
        f"Longest run: {max(r.device_s for r in results):.0f} s of device time.",
        "",
        "| kind | what goes wrong | runs | completed | waited | dark after fault, s | dark after seen, ms "
        "| lost | wrong | unsafe | hung | met as |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    rows = [_row(kind, [r for r in results if r.case.kind == kind]) for kind in kinds]
    return HEAD + "\n".join([*summary, *rows]) + "\n"


def _row(kind: str, runs: Sequence[Result]) -> str:
    meaning = KINDS[kind].meaning if kind in KINDS else HOST_KINDS[kind]
    unsafe = sum(not r.safe for r in runs)
    cells = [
        kind,
        meaning,
        len(runs),
        sum(r.state == "ready" and r.lines == 4 for r in runs),
        sum(r.suspensions > 0 for r in runs),
        _most(r.fault_to_dark_s for r in runs),
        _most((None if r.seen_to_dark_s is None else 1e3 * r.seen_to_dark_s for r in runs), 1),
        sum(r.lost for r in runs),
        sum(r.wrong for r in runs),
        unsafe,
        sum(bool(r.defect) for r in runs),
        _met_as(runs),
    ]
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def _most(values: Iterable[float | None], digits: int = 3) -> str:
    known = [v for v in values if v is not None]
    return f"{max(known):.{digits}f}" if known else ""


def _met_as(runs: Sequence[Result]) -> str:
    """Name the errors that the runs ended with, the most frequent first."""
    found = Counter(r.cause.split(":")[0] + _interlock(r.cause) for r in runs if r.cause)
    return ", ".join(f"{name} ({n})" for name, n in found.most_common(3))


def _interlock(cause: str) -> str:
    parts = cause.split("'")
    return f" {parts[1]}" if cause.startswith("InterlockTripped") and len(parts) > 2 else ""
