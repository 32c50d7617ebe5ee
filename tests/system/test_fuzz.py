"""Mutated files through every reader: read, or refused in words; never a traceback. The campaign is benchmarks/fuzz."""

from __future__ import annotations

import faulthandler
import json
import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from benchmarks.fuzz import worker
from benchmarks.fuzz.formats import FORMATS, Format
from benchmarks.fuzz.worker import Campaign, judged

ROOT = Path(__file__).resolve().parents[2]
RUN = ROOT / "benchmarks" / "fuzz" / "run.py"
SAMPLE = 60


@pytest.mark.parametrize("name", list(FORMATS))
def test_a_sample_of_each_format(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PICORADAR_CACHE", str(tmp_path / "cache"))
    form = FORMATS[name]
    path = tmp_path / f"input{form.suffix}"
    outcomes = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what NumPy says of odd numbers is no failure
        for content in form.sound:
            path.write_bytes(content)
            assert judged(form, path)[0] == "read"
        for index in range(SAMPLE):
            path.write_bytes(form.input(name, 3, index))
            outcomes.append((*judged(form, path), index))
    assert [found for found in outcomes if found[0] == "traceback"] == []
    assert {outcome for outcome, _, _ in outcomes} == {"read", "refused"}


def test_the_same_number_gives_the_same_input() -> None:
    assert FORMATS["json"].input("json", 1, 5) == FORMATS["json"].input("json", 1, 5)
    assert FORMATS["json"].input("json", 1, 5) != FORMATS["json"].input("json", 2, 5)


def fake(path: Path) -> None:
    """A reader that fails in every way, by the first byte of the file."""
    match path.read_bytes()[0]:
        case 1:
            raise KeyError("x")
        case 2:
            raise ValueError
        case 3:
            raise ValueError("what was found, and what to do about it")
        case 4:
            while True:
                pass
        case 5:
            os.abort()
        case 6:
            bytearray(b"\1") * 300_000_000


def test_what_is_no_refusal_in_words_is_seen(tmp_path: Path) -> None:
    form = Format(".x", lambda: [b"\0"], fake, (ValueError,))
    found = []
    for first in range(4):
        path = tmp_path / "x"
        path.write_bytes(bytes([first]))
        found.append(judged(form, path)[0])
    assert found == ["read", "traceback", "traceback", "refused"]


def counted() -> dict[str, int]:
    """Judge one input of every kind."""

    class Counted(Format):
        def input(self, name: str, seed: int, index: int) -> bytes:
            return bytes([index])

    faulthandler.disable()  # the crash is meant
    FORMATS["fake"] = Counted(".x", lambda: [b"\0"], fake, (ValueError,))
    worker.CPU_S = 8  # the memory below is written in a tenth of that, also on a slow machine
    worker.GROWTH_MB = 150
    campaign = Campaign("fake", 1)
    campaign.run(7)
    return dict(campaign.counts)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="limits and forks are POSIX")
def test_hangs_crashes_and_memory_are_counted() -> None:
    """In a program of its own: what a worker may take is counted from what the program that forks it has."""
    code = "import json, tests.system.test_fuzz as fuzz; print(json.dumps(fuzz.counted()))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True, timeout=240
    )
    assert json.loads(done.stdout) == {
        "read": 2, "traceback": 2, "refused": 1, "hang": 1, "crash": 1, "memory growth": 1,
    }  # fmt: skip


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.skipif(os.name == "nt", reason="limits and forks are POSIX")
def test_five_hundred_of_each_format_within_limits() -> None:
    command = [sys.executable, str(RUN), "all", "--count", "500", "--seed", "2"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    for name in FORMATS:
        assert f"| {name} | 500 |" in done.stdout
