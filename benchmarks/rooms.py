"""Rooms and sizes of the house: what `./run check` measures and limits.

    python benchmarks/rooms.py            # ./run check calls it; PYTHONPATH must lead to the package as one tree

A room is a child of one of the four packages; an arrow leads from a room to another one that it imports. That no arrow
runs upwards is the business of the import contracts (pyproject.toml). Exit status 1 when a limit is exceeded.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("drivers", "registration", "instrument", "sim")
COUNTED = ("drivers", "registration", "instrument")  # their rooms and arrows are limited; sim is printed beside them
MAX_ROOMS, MAX_ARROWS = 45, 160

MAX_FILE_LINES = 250
MAX_FUNCTION_LINES = 60
MAX_PARAMETERS = 7
MAX_ANY_LINES = 80
MAX_TYPE_IGNORES = 8

TABLES = ("instrument/controller/interlocks.py:interlocks",)
"""Functions that are tables of data."""
ENTRY_POINTS = ("register", "paired_points", "estimate", "prepare_model", "load_model", "SimulatedBench")
"""Entry points of the library, whose keyword arguments are a contract."""
COMMANDS = ("instrument/cli/commands/", "instrument/cli/main.py")
"""Where the signature of a function is the command line."""


@dataclass(frozen=True)
class Excess:
    """A place that exceeds a limit."""

    place: str
    what: str


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


def source_files() -> list[Path]:
    """Get the source files of the four packages."""
    return [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def functions(tree: ast.Module) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Get every function and method of a module."""
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def excesses(path: Path) -> Iterator[Excess]:
    """Find what exceeds a limit in a file."""
    name, text = path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")
    if (lines := len(text.splitlines())) > MAX_FILE_LINES:
        yield Excess(name, f"{lines} lines (at most {MAX_FILE_LINES})")
    for function in functions(ast.parse(text)):
        place = f"{name}:{function.name}"
        length = length_of(function)
        if length > MAX_FUNCTION_LINES and place not in TABLES:
            yield Excess(place, f"{length} lines (at most {MAX_FUNCTION_LINES})")
        if name.startswith(COMMANDS) or function.name in ENTRY_POINTS:
            continue
        if (count := len(parameters(function))) > MAX_PARAMETERS:
            yield Excess(place, f"{count} parameters (at most {MAX_PARAMETERS})")
        for argument in positional_booleans(function):
            yield Excess(place, f"boolean {argument} is positional")


def length_of(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Count the lines of a function without its docstring: a documented contract is no long function."""
    docstring = function.body[0] if ast.get_docstring(function) is not None else None
    documented = (docstring.end_lineno or docstring.lineno) - docstring.lineno + 1 if docstring else 0
    return (function.end_lineno or function.lineno) - function.lineno + 1 - documented


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> list[ast.arg]:
    """Get the parameters of a function without self and cls."""
    arguments = function.args
    every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    return [argument for argument in every if argument.arg not in ("self", "cls")]


def positional_booleans(function: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    """Get the names of boolean parameters that can be given by position.

    Setters of properties have no choice, and a function's only argument is its subject and no flag.
    """
    is_setter = any(isinstance(d, ast.Attribute) and d.attr == "setter" for d in function.decorator_list)
    if is_setter or len(parameters(function)) == 1:
        return []
    positional = [a for a in (*function.args.posonlyargs, *function.args.args) if a.annotation]
    return [a.arg for a in positional if a.annotation and ast.unparse(a.annotation) in ("bool", "bool | None")]


def any_and_ignores(path: Path) -> tuple[int, int]:
    """Count the lines of code with Any, and the comments that switch the type checker off."""
    any_lines, ignores = set(), 0
    for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline):
        if token.type == tokenize.NAME and token.string == "Any":
            any_lines.add(token.start[0])
        elif token.type == tokenize.COMMENT and "type: ignore" in token.string:
            ignores += 1
    return len(any_lines), ignores


def report_rooms() -> bool:
    """Print rooms and arrows; get whether they are within their limits."""
    graph = grimp.build_graph("picoradar")
    counts = {package: rooms_and_arrows(graph, package) for package in PACKAGES}
    rooms, arrows = (sum(counts[package][k] for package in COUNTED) for k in (0, 1))
    for package, (some, between) in counts.items():
        print(f"{package:>14}: {some:3} rooms, {between:3} arrows")
    print(f"{'without sim':>14}: {rooms:3} rooms (at most {MAX_ROOMS}), {arrows:3} arrows (at most {MAX_ARROWS})")
    return rooms <= MAX_ROOMS and arrows <= MAX_ARROWS


def report_sizes() -> bool:
    """Print what exceeds a limit of size; get whether nothing does."""
    files = source_files()
    found = [excess for path in files for excess in excesses(path)]
    for excess in found:
        print(f"  {excess.place}: {excess.what}")
    any_lines, ignores = (sum(counts) for counts in zip(*map(any_and_ignores, files), strict=True))
    print(f"{'all four':>14}: {len(found):3} places over a limit of size (none may be)")
    print(f"{'':>14}  {any_lines:3} lines with Any (at most {MAX_ANY_LINES})")
    print(f"{'':>14}  {ignores:3} type: ignore (at most {MAX_TYPE_IGNORES})")
    return not found and ignores <= MAX_TYPE_IGNORES and any_lines <= MAX_ANY_LINES


def main() -> int:
    within = [report_rooms(), report_sizes()]
    return int(not all(within))


if __name__ == "__main__":
    sys.exit(main())
