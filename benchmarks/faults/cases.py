"""What the fault campaign tries: every kind of fault, at every state of the controller, with three seeds."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from picoradar.instrument.controller import STATES
from picoradar.sim.faults import KINDS
from picoradar.sim.faults.fault import Link

SEEDS = (1, 2, 3)
HOST_KINDS = {
    "host_dead": "the host's process dies: nothing is sent any more",
    "host_stuck": "the host hangs for 5 s between two points, as in a slow disk",
    "disk_full": "the disk of the recording is full",
    "disk_error": "the disk of the recording fails",
    "sink_fails": "a viewer raises an error",
    "defect": "the program itself fails in the middle of a line",
}
LASTING: tuple[dict[str, Any], ...] = (
    {"lasts_s": 2.0},  # shorter than the limit of recovery
    {"lasts_s": 20.0},
    {},  # messages: one; states: for good
)


@dataclass(frozen=True)
class Case:
    """One run: a kind of fault on a link, striking in a state.

    Attributes
    ----------
    kind, link, state : str
    seed : int
    lasting : dict
        ``lasts_s`` and ``count`` of the fault.
    """

    kind: str
    link: str
    state: str
    seed: int
    lasting: dict[str, Any]

    def __str__(self) -> str:
        lasts = f" for {self.lasting['lasts_s']:g} s" if self.lasting else ""
        return f"{self.kind} on {self.link}{lasts}, {self.state}, seed {self.seed}"


def all_cases() -> Iterator[Case]:
    """Give every kind x state x seed; link and duration go round with them."""
    kinds: list[tuple[str, tuple[Link, ...] | tuple[str]]] = [(name, kind.links) for name, kind in KINDS.items()]
    kinds += [(name, ("host",)) for name in HOST_KINDS]
    for number, ((kind, links), (place, state), seed) in enumerate(itertools.product(kinds, enumerate(STATES), SEEDS)):
        link = links[(number // len(SEEDS) + seed) % len(links)]
        yield Case(kind, link, state, seed, LASTING[(seed + place) % len(LASTING)])


def selection() -> Iterator[Case]:
    """Give each kind once while the laser is on: the fast part, for every test run."""
    seen: set[str] = set()
    for case in all_cases():
        if case.state == "scanning" and case.kind not in seen:
            seen.add(case.kind)
            yield case
