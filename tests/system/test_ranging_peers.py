"""The peers that ranging is compared with find known instants, and the benchmark prints a row for each of them."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.ranging_peer_methods import PEERS, learn_form

ROOT = Path(__file__).parents[2]
SAMPLES = np.arange(1430.0)
INTERVAL = 600.37  # samples
ROUNDED = 0.05  # samples: a straight line between two of them, or a parabola, in place of a Gaussian's edge or top
AMONG = 1.3  # times the least deviation of any method; that of 40 readings is good to 11 %


def record(interval: float) -> np.ndarray:
    """Two Gaussian pulses whose rise and fall lie within the pieces that the peers look at."""
    return sum(h * np.exp(-0.5 * ((SAMPLES - at) / 22.0) ** 2) for h, at in ((45.0, 300.2), (40.0, 300.2 + interval)))


@pytest.mark.parametrize("name", PEERS)
def test_a_peer_finds_the_interval_of_two_pulses(name: str) -> None:
    form = learn_form(record(INTERVAL)[None])
    near, far = (PEERS[name](record(interval), form) for interval in (INTERVAL, INTERVAL + 10.25))
    assert near.echo - near.reference == pytest.approx(INTERVAL, abs=ROUNDED)
    assert far.echo - far.reference == pytest.approx(INTERVAL + 10.25, abs=ROUNDED)
    assert near.height_mv == pytest.approx(40.0, rel=0.01)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_every_method_has_a_row_and_the_template_is_among_the_best() -> None:
    script = [sys.executable, str(ROOT / "benchmarks" / "ranging_peers.py")]
    options = ["--readings", "40", "--training", "24", "--world", "dissertation", "--averages", "8"]
    done = subprocess.run([*script, *options], capture_output=True, text=True, check=True, timeout=280)
    tables = [part.splitlines() for part in done.stdout.strip().split("\n\n")]
    assert [table[0] for table in tables] == [f"dissertation, {mv} mV, averages 8" for mv in (15, 45, 150)]
    rows = {line[:24].strip(): line[24:].replace("|", " ").split() for line in tables[1][2:]}
    assert set(rows) == {*PEERS, "picoradar, half-maximum", "picoradar, template"}
    corrected = {name: float(cells[2]) for name, cells in rows.items()}
    assert corrected["picoradar, template"] <= AMONG * min(corrected.values())
    assert 0.7 < float(rows["picoradar, template"][5]) < 1.3  # error over stated, of 40 readings good to 11 %
    assert rows["matched filter"][5] == "none"
