"""No worked telegram of the serial protocol sheets may be missing from the golden tables."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

GOLDEN = Path(__file__).parent
SHEETS = Path(__file__).parents[2].parent / "shared" / "protocols"


def words_of(name):
    """Give every text of a golden table, without line ends."""
    tables = tomllib.loads((GOLDEN / f"{name}.toml").read_text())
    return {text.strip() for rows in tables.values() for row in rows for text in row}


@pytest.fixture
def sheet():
    def read(name):
        path = SHEETS / f"{name}.md"
        if not path.exists():
            pytest.skip(reason=f"the protocol sheets are not beside the repository ({path})")
        return path.read_text()

    return read


def test_mecom(sheet):
    telegrams = set(re.findall(r"`([#!][0-9A-F]{6}[^`]*)`", sheet("mecom_tec")))
    assert len(telegrams) > 30
    assert telegrams <= words_of("mecom")


def test_dg645(sheet):
    exchange = sheet("dg645").partition("## Worked exchange")[2].partition("Bytes of")[0]
    rows = [line for line in exchange.splitlines() if line.startswith("| `")]
    texts = {text for row in rows for text in re.findall(r"`([^`]+)`", row)}
    assert len(texts) > 20
    assert texts <= words_of("dg645")


def test_genesys(sheet):
    exchange = sheet("tdk_genesys").partition("## Worked exchange")[2].partition("Bytes of")[0]
    table = re.search(r"^\| text \| check sum \| .*\n\|[-|]+\n((?:\|.*\n)+)", sheet("tdk_genesys"), re.MULTILINE)
    check_sums = re.findall(r"^\| (?:reply )?`([^`]+)` \| [0-9A-F]{2} \| `([^`]+)` CR", table[1], re.MULTILINE)
    texts = set(re.findall(r"`([^`]+)`", exchange)) | {text for pair in check_sums for text in pair}
    assert len(check_sums) == len(table[1].splitlines()) >= 6
    assert len(texts) > 30
    assert texts <= words_of("genesys")
