"""Tables that a benchmark writes into a document, between marks that carry its name."""

from __future__ import annotations

import datetime
import platform
from pathlib import Path

ROOT = Path(__file__).parents[2]


def write_between_marks(document: str, name: str, lines: list[str]) -> None:
    """Replace what stands between the marks of `name` in ``docs/<document>``.

    Raises
    ------
    ValueError
        When the document lacks one of the two marks.
    """
    path = ROOT / "docs" / document
    text = path.read_text(encoding="utf-8")
    begin, end = f"<!-- begin: written by {name} -->", f"<!-- end: written by {name} -->"
    head, found, rest = text.partition(begin)
    _, closed, tail = rest.partition(end)
    if not found or not closed:
        raise ValueError(f"{path}: the marks of {name} are missing; put in '{begin}' and '{end}'")
    path.write_text(f"{head}{begin}\n\n" + "\n".join(lines) + f"\n\n{end}{tail}", encoding="utf-8")
    print(f"written: {path}")


def rows_between_marks(document: str, name: str, cells: int) -> dict[str, str]:
    """Rows of so many cells that stand there from an earlier run, by their first cell; headings are left out."""
    text = (ROOT / "docs" / document).read_text(encoding="utf-8")
    section = text.partition(f"<!-- begin: written by {name} -->")[2].partition("<!-- end")[0]
    rows = [line for line in section.splitlines() if line.startswith("| ") and line.count("|") == cells + 1]
    return {line.split("|")[1].strip(): line for line in rows[1:]}


def provenance() -> str:
    """Date and machine, for the line above a table."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    cpu = next((line.split(":")[1].strip() for line in lines if "model name" in line), platform.machine())
    return f"{datetime.date.today()}, {cpu}, one thread, Python {platform.python_version()}."
