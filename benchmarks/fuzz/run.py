"""Mutated files through every reader: is each one read or refused in words?

    python benchmarks/fuzz/run.py stl --count 20000 --seed 1
    python benchmarks/fuzz/run.py all --count 20000 --seed 1       # every format, one after the other
    python benchmarks/fuzz/run.py stl --seed 1 --only 417 -o 417.stl   # that input again, with its traceback

Each worker is a process of its own with 2 GB of address space; an input has 10 s of processor time. Printed is one row
a format, and what ended in a traceback, once for each place in the code. Exit status 1 if anything was neither read nor
refused in words. POSIX only.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.fuzz.formats import FORMATS
from benchmarks.fuzz.worker import ADDRESS_SPACE_BYTES, CPU_S, Campaign, judged

HEAD = (
    "| format | inputs | read | refused in words | traceback | hang | crash | memory growth | MB at most | s of CPU |"
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("format", choices=[*FORMATS, "all"])
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="one input, in this process, with its traceback")
    parser.add_argument("-o", type=Path, help="with --only: keep the input")
    options = parser.parse_args()
    if options.only is not None:
        return again(options.format, options.seed, options.only, options.o)
    print(f"{ADDRESS_SPACE_BYTES / 1e9:g} GB of address space, {CPU_S} s of processor time for each input\n")
    print(HEAD + "\n" + "|---" * HEAD.count(" | ") + "|---|")
    sound = True
    for name in FORMATS if options.format == "all" else [options.format]:
        campaign = Campaign(name, options.seed)
        campaign.run(options.count)
        print(campaign.row(), flush=True)
        for place, found in campaign.places.items():
            print(f"    {len(found)} x {place}; first: --only {found[0]}", flush=True)
        sound = sound and not campaign.bad
    return int(not sound)


def again(name: str, seed: int, index: int, kept: Path | None) -> int:
    """Read one input and let its traceback through."""
    content = FORMATS[name].input(name, seed, index)
    with tempfile.TemporaryDirectory() as folder:
        path = kept or Path(folder, f"input{FORMATS[name].suffix}")
        path.write_bytes(content)
        began = time.process_time()
        outcome, detail = judged(FORMATS[name], path, through=True)
        print(f"{outcome} after {time.process_time() - began:.3f} s, {len(content)} bytes: {detail}")
        print(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000:.0f} MB at most")
    return int(outcome not in ("read", "refused"))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    warnings.simplefilter("ignore")
    sys.exit(main())
