"""Bodies with sharp edges, of which sparse strips hold some motions: is there a confident wrong pose among them?

    python benchmarks/registration/sharp_bodies.py --scenes 2000 --seed-base 100000

A wrong pass is a verdict "pass" with an error over 1 deg, or over 1 mm at any of the points, whatever symmetry the body
has. The floor of a scene is the Cramer-Rao bound at the true pose, with the true noise; it allows a pass where the root
mean square errors there are under half the limits. Ambiguous are scenes that the floor allows, but whose points without
noise another pose explains as well, as the result or its rivals show: they are none of those that should pass.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first
from sharp_scenes import KINDS, LIMIT_DEG, LIMIT_MM, STARTS, Scene, make_scene  # noqa: E402

from picoradar import registration  # noqa: E402


@dataclass(frozen=True)
class Outcome:
    """What became of a scene."""

    scene: Scene
    verdict: str
    turn_deg: float
    shift_mm: float
    ambiguous: bool
    cpu_ms: float

    @property
    def wrong_pass(self) -> bool:
        """A pass beyond the limits."""
        return self.verdict == "pass" and (self.turn_deg > LIMIT_DEG or self.shift_mm > LIMIT_MM)

    @property
    def allowed(self) -> bool:
        """Whether the floor allows a pass, and no other pose explains the points as well."""
        return self.scene.allowed and not (self.ambiguous and self.verdict != "pass")


def run(seeds: range) -> Iterator[Outcome]:
    """Register the scenes of the seeds."""
    for seed in seeds:
        scene = make_scene(seed)
        began = time.process_time()
        try:
            found = scene.register()
        except registration.RegistrationError as error:
            cpu_ms = (time.process_time() - began) * 1e3
            yield Outcome(scene, f"refused: {error}", np.nan, np.nan, ambiguous=False, cpu_ms=cpu_ms)
            continue
        cpu_ms = (time.process_time() - began) * 1e3
        yield Outcome(scene, found.verdict, *scene.errors(found.model_from_scanner), scene.ambiguous(found), cpu_ms)


def row(title: str, some: list[Outcome]) -> str:
    """A row of the table."""
    allowed = [o for o in some if o.allowed]
    passed = sum(o.verdict == "pass" for o in allowed)
    share = f"{passed} of {len(allowed)} ({passed / len(allowed):.0%})" if allowed else "none allowed"
    refused, cautioned, failed = (
        sum(o.verdict.startswith(word) for o in some) for word in ("refused", "caution", "fail")
    )
    ambiguous = sum(o.scene.allowed and not o.allowed for o in some)
    wrong, cpu = sum(o.wrong_pass for o in some), np.median([o.cpu_ms for o in some])
    return (
        f"| {title} | {len(some)} | {wrong} | {share} | {ambiguous} | {cautioned} | {failed} | {refused} | {cpu:.0f} |"
    )


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=500)
    parser.add_argument("--seed-base", type=int, default=0)
    asked = parser.parse_args()
    outcomes: list[Outcome] = []
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PICORADAR_CACHE"] = folder
        for outcome in run(range(asked.seed_base, asked.seed_base + asked.scenes)):
            outcomes.append(outcome)
            left = (time.monotonic() - began) / len(outcomes) * (asked.scenes - len(outcomes))
            if len(outcomes) % 10 == 0:
                print(f"\r{len(outcomes)} of {asked.scenes}, {left:.0f} s left ", end="", file=sys.stderr, flush=True)
            if outcome.wrong_pass:
                where = outcome.scene
                print(
                    f"wrong pass: seed {where.seed}, {where.body.kind}, start {where.start_name}, "
                    f"{outcome.turn_deg:.2f} deg, {outcome.shift_mm:.2f} mm"
                )
    print(
        "\n| scenes | number | wrong passes | passes where the floor allows | ambiguous | cautions | fails | refusals "
        "| CPU ms |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for kind in KINDS:
        print(row(kind, [o for o in outcomes if o.scene.body.kind == kind]))
    print(row("of these, a face and strips", [o for o in outcomes if o.scene.strips]))
    for start in STARTS:
        print(row(f"of these, start: {start}", [o for o in outcomes if o.scene.start_name == start]))
    print(row("all", outcomes))


if __name__ == "__main__":
    main()
