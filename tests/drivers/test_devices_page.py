"""The example driver of docs/devices.md and its tests run as they stand there."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from picoradar.drivers.links import SerialLink

PAGE = Path(__file__).parents[2] / "docs" / "devices.md"
NAMESPACE: dict[str, Any] = {"__name__": "devices_page"}
for block in re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL):
    exec(compile(block, str(PAGE), "exec"), NAMESPACE)
SHOWN = [name for name in NAMESPACE if name.startswith("test_")]


@pytest.mark.parametrize("name", SHOWN)
def test_shown_on_the_page(name: str, scripted: Callable[..., SerialLink]) -> None:
    NAMESPACE[name](scripted)


def test_the_page_shows_tests() -> None:
    assert len(SHOWN) >= 3
