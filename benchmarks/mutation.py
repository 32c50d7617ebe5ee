"""Do the tests notice when the substance of a core file changes? A mutation run on demand.

    python benchmarks/mutation.py run                       # 150 mutants of every core file (hours)
    python benchmarks/mutation.py run template_fit --count 30 --jobs 2
    python benchmarks/mutation.py show template_fit         # its survivors
    python benchmarks/mutation.py write                     # docs/mutation.md from the results

A mutant is killed when one test of its file's room alone fails, or does not end in time. One process imports the
libraries and forks for each mutant, in which a finder puts the changed module in place of the true one; only tests
that reach the changed lines run, the quickest first. Results are kept as JSON lines; a run that was stopped
goes on, and survivors are tried again when the tests have changed.
"""

from __future__ import annotations

import argparse
import json
import tomllib
from typing import Any

from mutation_room import ROOT, Room

RESULTS = ROOT / "benchmarks" / "mutation.jsonl"
EQUIVALENT = ROOT / "benchmarks" / "mutation_equivalent.toml"
PAGE = ROOT / "docs" / "mutation.md"
COUNT = 150
PREFACE = """# Mutation: do the tests notice?

`python benchmarks/mutation.py run` changes one thing in a core file (a comparison, a sign, a constant, a condition, a
statement left out, ...), runs the tests of that file's room alone, and does so for a seeded sample of 150 changes a
file. A mutant is *killed* when a test fails. The aim is at least 85 % of those that are not equivalent, which means
that no input makes their result differ in a way that matters. Of a file with fewer possible changes than that, all are
tried: those columns are then equal; of a file that has changed since, none. Results: `benchmarks/mutation.jsonl`.

| file | possible | tried | killed | equivalent | survived | killed of the rest |
|---|---|---|---|---|---|---|"""

RANGING = ["tests/instrument/test_ranging*.py"]
EDGES = "tests/instrument/test_ranging.py"
CONTROLLER = ["tests/instrument/controller/test_*.py", "tests/instrument/test_controller_safety.py"]
INTERLOCKS = [f"tests/instrument/test_controller_{of}.py" for of in ("interlocks", "docs")]
QUALITY = "tests/registration/test_quality.py"
CODES = "tests/drivers/test_wire_codes.py"
TESTS: dict[str, list[str]] = {
    "instrument/ranging/template_fit.py": RANGING,
    "instrument/ranging/half_maximum.py": ["tests/instrument/test_ranging_half_maximum.py", EDGES],
    "instrument/ranging/pulses.py": ["tests/instrument/test_ranging_pulses.py", EDGES],
    "instrument/ranging/pair.py": ["tests/instrument/test_ranging_pair.py", EDGES],
    "instrument/controller/safety.py": CONTROLLER,
    "instrument/controller/interlocks.py": INTERLOCKS,
    "instrument/controller/run.py": CONTROLLER,
    "instrument/controller/ending.py": CONTROLLER,
    "instrument/controller/supervision.py": CONTROLLER,
    "instrument/controller/subscribers.py": ["tests/instrument/controller/test_subscribers.py"],
    "registration/refine/beam_fit.py": ["tests/registration/test_beam_fit*.py"],
    "registration/refine/weak_modes.py": ["tests/registration/test_weak_modes.py"],
    "registration/scan/tissue.py": ["tests/registration/test_tissue.py"],
    "registration/trust/covariance.py": ["tests/registration/test_covariance.py", QUALITY],
    "registration/trust/verdict.py": ["tests/registration/test_verdict.py"],
    "drivers/dg645/wire.py": ["tests/drivers/test_dg645*.py", CODES],
    "drivers/genesys/wire.py": ["tests/drivers/test_genesys*.py", CODES],
    "drivers/mecom/wire.py": ["tests/drivers/test_mecom*.py", CODES],
    "drivers/helios/wire.py": ["tests/drivers/test_helios*.py", CODES],
    "drivers/bridge/sbp/frames.py": ["tests/drivers/test_sampling_bridge*.py", CODES],
    "drivers/links/usbtmc_wire.py": ["tests/drivers/test_usbtmc*.py", CODES],
}


def read_all() -> list[dict[str, Any]]:
    return [json.loads(line) for line in RESULTS.read_text().splitlines()] if RESULTS.exists() else []


def results(room: Room) -> list[dict[str, Any]]:
    """Results of the file as it is now, in the order of its text; ``why`` says of a survivor that it is equivalent."""
    mine = {r["mutant"]: r for r in read_all() if (r["file"], r["source"]) == (room.file, room.digest)}
    known = tomllib.loads(EQUIVALENT.read_text(encoding="utf-8")).get("equivalent", [])
    why = {(k["file"], k["function"], k["change"]): k["why"] for k in known}
    return [{**mine[k], "why": why.get((room.file, mine[k]["function"], mine[k]["change"]), "")} for k in sorted(mine)]


def forget_others(present: set[tuple[str, str]]) -> None:
    """Drop the results of sources as they are no more, and all but the last of each mutant."""
    last = {(r["file"], r["mutant"]): r for r in read_all() if (r["file"], r["source"]) in present}
    RESULTS.write_text("".join(json.dumps(row) + "\n" for row in last.values()), encoding="utf-8")


def run(files: list[str], count: int, jobs: int) -> None:
    for file in files:
        room = Room(file, TESTS[file])
        tried = results(room)
        done = {r["mutant"] for r in tried if r["killed"] or r["why"] or r.get("tests") == room.tests_digest}
        for row in room.run(count, jobs, done):
            with RESULTS.open("a", encoding="utf-8") as out:
                out.write(json.dumps(row) + "\n")
            if not row["killed"]:
                print(f"{file}:{row['line']} {row['function']}: {row['change']}", flush=True)
        print(summary(room), flush=True)


def summary(room: Room) -> str:
    rows = results(room)
    killed, same = sum(r["killed"] for r in rows), sum(bool(r["why"]) and not r["killed"] for r in rows)
    share = f"{100 * killed / (len(rows) - same):.0f} %" if len(rows) > same else "-"
    left = len(rows) - killed - same
    return f"| `{room.file}` | {len(room.mutants)} | {len(rows)} | {killed} | {same} | {left} | {share} |"


def show(files: list[str]) -> None:
    for file in files:
        for row in results(Room(file, TESTS[file])):
            if not row["killed"]:
                print(f"{file}:{row['line']} {row['function']}: {row['change']}  {row['why']}")


def page() -> str:
    """Write docs/mutation.md."""
    rooms = [Room(file, TESTS[file]) for file in TESTS if (ROOT / file).exists()]
    rows = {room.file: results(room) for room in rooms}
    forget_others({(room.file, room.digest) for room in rooms})
    lines = [PREFACE, *(summary(room) for room in rooms), "", "## Equivalent mutants", ""]
    lines += [
        f"* `{file}`, `{r['function']}`: `{r['change']}`: {r['why']}"
        for file, mine in rows.items()
        for r in mine
        if r["why"] and not r["killed"]
    ]
    lines += ["", "## Survivors", ""]
    lines += [
        f"* `{file}:{r['line']}`, `{r['function']}`: `{r['change']}`"
        for file, mine in rows.items()
        for r in mine
        if not (r["killed"] or r["why"])
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("verb", choices=("run", "show", "write"))
    parser.add_argument("files", nargs="*", help="parts of the names of core files; all without")
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="write the page after the run")
    given = parser.parse_args()
    files = [f for f in TESTS if (ROOT / f).exists() and (not given.files or any(part in f for part in given.files))]
    if given.verb == "run":
        run(files, given.count, given.jobs)
    elif given.verb == "show":
        show(files)
    if given.verb == "write" or given.write:
        PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
