"""CONTRIBUTING.md names files and names that are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
PATHS = sorted(set(re.findall(r"`((?:instrument|drivers|registration|sim|tests|benchmarks|docs)/[\w/.]*)[ `]", TEXT)))
NAMES = re.findall(r"`(\w+)` of\s+`([\w/]+\.py)`|`([\w/]+\.py)` \(`(\w+)`", TEXT)


@pytest.mark.parametrize("path", PATHS)
def test_what_it_names_is_there(path: str) -> None:
    assert (ROOT / path).exists()


@pytest.mark.parametrize(("file", "name"), [(b or c, a or d) for a, b, c, d in NAMES])
def test_the_names_are_in_their_files(file: str, name: str) -> None:
    assert re.search(rf"\b{name}\b", (ROOT / file).read_text(encoding="utf-8"))


def test_it_names_enough() -> None:
    assert len(PATHS) > 20
    assert len(NAMES) >= 5
