"""Workers of the fuzzer: processes with limits that read one input after the other, and the count of what came out."""

from __future__ import annotations

import os
import resource
import select
import signal
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from typing import NoReturn

from benchmarks.fuzz.formats import FORMATS, Format

ADDRESS_SPACE_BYTES = 2_000_000_000
CPU_S = 10
GROWTH_MB = 500
"""More memory than this for one small input counts as growth."""

LEAST_WORDS = 10
"""Letters that a refusal has beside the name of the file."""

SILENT_S = 120.0
"""Wall time after which a worker that says nothing is killed: it hangs without using the processor."""


def judged(form: Format, path: Path, *, through: bool = False) -> tuple[str, str]:
    """Read a file, and say what came of it: ``read``, ``refused`` or ``traceback``, with words or place.

    Parameters
    ----------
    form : Format
    path : Path
    through : bool
        Let an exception that is no refusal through.
    """
    try:
        form.read(path)
    except form.refusals as error:
        words = str(error)
        if len(words.replace(str(path), "")) > LEAST_WORDS:
            return "refused", words
        return "traceback", f"{type(error).__name__} without words"
    except Exception as error:
        if through:
            raise
        own = [
            f for f in traceback.extract_tb(error.__traceback__) if "picoradar" in f.filename or "/fuzz/" in f.filename
        ]
        where = f"{Path(own[-1].filename).name}:{own[-1].lineno}" if own else "?"
        return "traceback", f"{type(error).__name__} at {where} ({str(error)[:80]})"
    return "read", ""


class Campaign:
    """Inputs of one format, and how many came to what."""

    def __init__(self, name: str, seed: int) -> None:
        self.name = name
        self.seed = seed
        self.form = FORMATS[name]
        self.counts: Counter[str] = Counter()
        self.places: dict[str, list[int]] = {}
        self.most_mb = 0
        self.cpu_s = 0.0

    @property
    def bad(self) -> int:
        """Get how many inputs were neither read nor refused in words, or took too much."""
        return sum(self.counts[kind] for kind in ("traceback", "hang", "crash", "memory growth"))

    def run(self, count: int) -> None:
        """Read so many inputs; a worker that dies is replaced, and its input counted."""
        _ = self.form.sound  # made once, before the workers are forked
        began = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = 0
        while done < count:
            done = self._one_worker(done, count)
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        self.cpu_s = ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime

    def row(self) -> str:
        """Get the row of the table."""
        kinds = ("read", "refused", "traceback", "hang", "crash", "memory growth")
        numbers = " | ".join(str(self.counts[kind]) for kind in kinds)
        total = (
            self.counts["read"]
            + self.counts["refused"]
            + self.counts["traceback"]
            + self.counts["hang"]
            + self.counts["crash"]
        )
        return f"| {self.name} | {total} | {numbers} | {self.most_mb} | {self.cpu_s:.0f} |"

    def _one_worker(self, first: int, count: int) -> int:
        reading, writing = os.pipe()
        process = os.fork()
        if process == 0:
            os.close(reading)
            _work(self.name, self.seed, range(first, count), writing)
        os.close(writing)
        done, silent = first, False
        with os.fdopen(reading, "r", encoding="utf-8", errors="replace") as told:
            while True:
                if not select.select([told], [], [], SILENT_S)[0]:
                    silent = True
                    os.kill(process, signal.SIGKILL)
                line = told.readline()
                if not line:
                    break
                self._count(done, *line.rstrip("\n").split("\t", 2))
                done += 1
        status = os.waitpid(process, 0)[1]
        if done < count:
            hang = silent or (os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL))
            self._count(done, "hang" if hang else "crash", "0", f"worker ended with {status}")
            done += 1
        return done

    def _count(self, index: int, outcome: str, grown_mb: str, detail: str) -> None:
        self.counts[outcome] += 1
        self.most_mb = max(self.most_mb, int(grown_mb))
        if int(grown_mb) > GROWTH_MB:
            self.counts["memory growth"] += 1
            self.places.setdefault(f"memory grown by more than {GROWTH_MB} MB", []).append(index)
        if outcome not in ("read", "refused"):
            self.places.setdefault(f"{outcome}: {detail}", []).append(index)


def _work(name: str, seed: int, indices: range, writing: int) -> NoReturn:
    """Read inputs until the end, in a process that ends here."""
    form = FORMATS[name]
    os.environ["PICORADAR_CACHE"] = "/nonexistent"  # what is prepared is not kept
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE_BYTES, ADDRESS_SPACE_BYTES))
    with tempfile.TemporaryDirectory() as folder, os.fdopen(writing, "w", buffering=1, encoding="utf-8") as told:
        for index in indices:
            path = Path(folder, f"input{form.suffix}")
            path.write_bytes(form.input(name, seed, index))
            used = resource.getrusage(resource.RUSAGE_SELF)
            limit = int(used.ru_utime + used.ru_stime) + CPU_S + 1
            resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.getrlimit(resource.RLIMIT_CPU)[1]))
            outcome, detail = judged(form, path)
            grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used.ru_maxrss) // 1000
            told.write(f"{outcome}\t{grown_mb}\t{' '.join(detail.split())[:200]}\n")
            for leftover in Path(folder).iterdir():
                leftover.unlink()
    time.sleep(0)
    os._exit(0)
