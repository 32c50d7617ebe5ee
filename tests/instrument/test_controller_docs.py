"""The documents say what the program does: tables from its source, tests that exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from picoradar.instrument.controller import STATES
from picoradar.instrument.controller.page import renewed

ROOT = Path(__file__).parents[2]


def test_the_page_of_the_controller_is_up_to_date() -> None:
    page = (ROOT / "docs" / "controller.md").read_text(encoding="utf-8")
    assert page == renewed(page), "run: python -m picoradar.instrument.controller.page docs/controller.md"
    assert all(f"| `{state}` |" in page for state in STATES)


def test_a_page_without_a_place_for_a_part_is_refused() -> None:
    with pytest.raises(ValueError, match="states"):
        renewed("# nothing")


def test_every_test_that_the_hazard_table_names_exists() -> None:
    table = (ROOT / "docs" / "safety.md").read_text(encoding="utf-8")
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", table)
    assert len(named) >= 18
    for file, name in named:
        text = (ROOT / file).read_text(encoding="utf-8")
        assert re.search(rf"^(def {name}\(|{name} = )", text, re.MULTILINE), f"{file}::{name}"
