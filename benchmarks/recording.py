"""What a durable line costs, what compression gains, and whether kill -9 loses anything.

    python benchmarks/recording.py lines [--folder DIR]
    python benchmarks/recording.py compression [RECORDING]
    python benchmarks/recording.py kills [--count 200] [--seed 1]

`lines` writes into a new folder under DIR (default: the current one, for /tmp may lie in memory, where nothing is
durable). `compression` takes the traces of a recording, or synthetic ones. `kills` starts a program that writes lines,
kills it at a random instant, checks every line that it had acknowledged, lets the next one go on with the same file.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import zstandard
from numpy.typing import NDArray

from picoradar.drivers.traces import CodeScale, Trace
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording

WRITER = Path(__file__).resolve().parents[1] / "tests" / "instrument" / "recording_writer.py"
SAMPLES, SWEEPS = 1430, 8
FORM = {"start_ps": 6500.0, "step_ps": 6.7, "samples": SAMPLES, "zero_code": 40.0, "mv_per_code": 0.5}
KILLS_A_FILE = 10


def synthetic_sums(count: int, rng: np.random.Generator) -> NDArray[np.uint16]:
    """Return (count, 1430) sums of 8 sweeps: reference, echo, noise of 1.5 codes."""
    t = 6.7 * np.arange(SAMPLES)
    echo_ps = 5000 + rng.normal(scale=30, size=(count, 1))
    pulses = 100 * np.exp(-(((t - 1100) / 260) ** 2)) + 80 * np.exp(-(((t - echo_ps) / 260) ** 2))
    codes = [np.clip(np.round(40 + pulses + rng.normal(scale=1.5, size=pulses.shape)), 0, 255) for _ in range(SWEEPS)]
    return np.sum(codes, axis=0).astype(np.uint16)


def line(index: int, count: int, sums: NDArray[np.uint16] | None, rng: np.random.Generator) -> ScanLine:
    """Return a line of `count` places."""
    return ScanLine(
        index=index,
        columns=np.arange(count, dtype=np.int32),
        angles_rad=rng.normal(size=(count, 2)),
        points_mm=rng.normal(size=(count, 3)),
        covariance_mm2=rng.normal(size=(count, 3, 3)),
        range_mm=rng.normal(size=count),
        range_variance_mm2=rng.normal(size=count),
        response_mv=rng.normal(size=count),
        flags=np.zeros(count, dtype=np.uint16),
        traces=None if sums is None else Trace(sums, SWEEPS, 6500.0 + 6.7 * np.arange(SAMPLES), CodeScale(40.0, 0.5)),
        sweeps=SWEEPS,
        device_time_s=float(index),
    )


def measure_lines(folder: Path) -> None:
    """Print the time of one durable line."""
    rng = np.random.default_rng(1)
    print("places  traces  lines   median ms   p99 ms   size MB   read+check ms a line")
    for count in (40, 110):
        for traces in (False, True):
            sums = synthetic_sums(count, rng) if traces else None
            lines = [line(k, count, sums, rng) for k in range(200)]
            with tempfile.TemporaryDirectory(dir=folder) as place:
                path = Path(place) / "scan.db"
                times = []
                with Recording.create(
                    path, {"raster": {"rows": len(lines), "columns": count}, "trace": FORM}
                ) as recording:
                    for entry in lines:
                        began = time.perf_counter()
                        recording.append(entry)
                        times.append(1e3 * (time.perf_counter() - began))
                    recording.finish("complete", laser_off_verified=True)
                began = time.perf_counter()
                with Recording.open(path) as recording:
                    whole = all(check.ok for check in recording.check())
                read_ms = 1e3 * (time.perf_counter() - began) / len(lines)
                size = path.stat().st_size / 1e6
            middle, late = np.percentile(times, [50, 99])
            figures = f"{middle:11.2f} {late:8.1f} {size:9.2f} {read_ms:10.2f}"
            print(f"{count:6d}  {traces!s:6}  {len(lines):5d} {figures}" + ("" if whole else "   DAMAGED"))


def measure_compression(recording: Path | None) -> None:
    """Print how small and how fast several ways to pack traces are."""
    if recording is None:
        sums = synthetic_sums(1600, np.random.default_rng(1))
    else:
        with Recording.open(recording) as scan:
            sums = np.concatenate([entry.sums for entry in scan.lines() if entry.sums is not None])
    print(f"{sums.shape[0]} traces of {sums.shape[1]} samples, {sums.nbytes / 1e6:.2f} MB")
    ways: dict[str, Callable[[NDArray[np.unsignedinteger]], bytes]] = {
        "words as they are": lambda a: a.tobytes(),
        "low bytes, then high bytes": _planes,
        "folded steps, low then high": lambda a: _planes(_zigzag(a)),
    }
    for name, arrange in ways.items():
        for level in (1, 3, 9):
            packer = zstandard.ZstdCompressor(level=level)
            began = time.perf_counter()
            packed = [packer.compress(arrange(sums[k : k + 40])) for k in range(0, len(sums), 40)]
            seconds = time.perf_counter() - began
            ratio = sums.nbytes / sum(map(len, packed))
            print(f"{name:28} zstd {level}: ratio {ratio:5.2f}, {sums.nbytes / 1e6 / seconds:6.0f} MB/s")


def _planes(sums: NDArray[np.unsignedinteger]) -> bytes:
    return np.ascontiguousarray(sums.view(np.uint8).reshape(-1, sums.dtype.itemsize).T).tobytes()


def _zigzag(sums: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    steps = np.diff(sums.astype(np.int64), axis=1, prepend=0)
    return np.abs(2 * steps + (steps < 0)).astype(sums.dtype)


def killed_writer(path: Path, after_s: float) -> set[int]:
    """Let a program write lines, kill it some time after its first one, return what it had acknowledged."""
    with subprocess.Popen([sys.executable, str(WRITER), str(path)], stdout=subprocess.PIPE) as process:
        output = process.stdout
        if output is None:
            raise RuntimeError("the pipe from the writing program was not made")
        first = output.readline()
        time.sleep(after_s)
        process.kill()
        return {int(word) for word in (first + output.read()).split(b"\n")[:-1]}


def measure_kills(count: int, seed: int) -> bool:
    """Kill a writing program `count` times; return whether nothing was lost. Each file is gone on with nine times."""
    rng = np.random.default_rng(seed)
    total = lost = damaged = 0
    with tempfile.TemporaryDirectory() as place:
        for first in range(0, count, KILLS_A_FILE):
            path = Path(place) / f"scan{first}.db"
            acknowledged: set[int] = set()
            for _ in range(min(KILLS_A_FILE, count - first)):
                acknowledged |= killed_writer(path, rng.uniform(0.0, 0.12))
                with Recording.open(path) as recording:
                    lost += len(acknowledged - set(recording.done))
                    damaged += sum(not check.ok for check in recording.check())
            total += len(acknowledged)
    print(f"{count} kills, {total} lines acknowledged, {lost} lost, {damaged} damaged")
    return not lost and not damaged


def main() -> int:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    jobs = parser.add_subparsers(dest="job", required=True)
    jobs.add_parser("lines").add_argument("--folder", type=Path, default=Path.cwd())
    jobs.add_parser("compression").add_argument("recording", type=Path, nargs="?")
    kills = jobs.add_parser("kills")
    kills.add_argument("--count", type=int, default=200)
    kills.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    if asked.job == "lines":
        measure_lines(asked.folder)
    elif asked.job == "compression":
        measure_compression(asked.recording)
    elif not measure_kills(asked.count, asked.seed):
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
