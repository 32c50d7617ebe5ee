"""How many rooms the house has and how many arrows run between them; a room is a child of one of the four packages.

    python benchmarks/rooms.py            # ./run check calls it; PYTHONPATH must lead to the package as one tree

Exit status 1 when the rooms of drivers, registration and instrument are more than 45, or their arrows more than 160.
That no arrow runs upwards is the import contracts' business (pyproject.toml).
"""

from __future__ import annotations

import sys
from collections import defaultdict

import grimp

COUNTED = ("drivers", "registration", "instrument")
BESIDE = ("sim",)
MAX_ROOMS, MAX_ARROWS = 45, 160


def rooms_and_arrows(graph: grimp.ImportGraph, package: str) -> tuple[int, int]:
    """Count the rooms of a package and the pairs of them of which one imports the other."""
    root = f"picoradar.{package}"
    arrows: defaultdict[tuple[str, str], int] = defaultdict(int)
    for module in graph.find_descendants(root):
        for imported in graph.find_modules_directly_imported_by(module):
            here, there = room_of(module), room_of(imported)
            if imported.startswith(f"{root}.") and here != there:
                arrows[here, there] += 1
    return len(graph.find_children(root)), len(arrows)


def room_of(module: str) -> str:
    """Get the room that a module lies in."""
    return ".".join(module.split(".")[:3])


def main() -> int:
    graph = grimp.build_graph("picoradar")
    counts = {package: rooms_and_arrows(graph, package) for package in (*COUNTED, *BESIDE)}
    rooms, arrows = (sum(counts[package][k] for package in COUNTED) for k in (0, 1))
    for package, (some, between) in counts.items():
        print(f"{package:>14}: {some:3} rooms, {between:3} arrows")
    print(f"{'without sim':>14}: {rooms:3} rooms (at most {MAX_ROOMS}), {arrows:3} arrows (at most {MAX_ARROWS})")
    return int(rooms > MAX_ROOMS or arrows > MAX_ARROWS)


if __name__ == "__main__":
    sys.exit(main())
