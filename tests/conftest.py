"""Tests marked `slow` run with ``--slow`` only: the continuous integration gives it, the README's command does not."""

from __future__ import annotations

import os
import tempfile

import pytest

# The incidents that tests provoke are none of this computer's radar; programs that tests start inherit this.
os.environ["PICORADAR_LOG"] = tempfile.mkdtemp(prefix="picoradar-incidents-")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="also run the slower tier")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--slow"):
        return
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.skip(reason="slower tier; run it with --slow"))
