"""`Room`: one core file and its tests, and the processes in which its mutants are tried (see mutation.py)."""

from __future__ import annotations

import hashlib
import importlib.abc
import importlib.util
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mutants import Mutant, mutants, sampled

ROOT = Path(__file__).resolve().parents[1]
LIMIT_S, LIMIT_TIMES = 20.0, 5.0  # a mutant may take so much longer than the tests by themselves
UNREACHED = 5  # pytest's exit code when no test was left


class Changed(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Gives a changed module in place of the file's."""

    def __init__(self, name: str, file: Path, code: Any) -> None:
        self.name, self.file, self.code = name, file, code

    def find_spec(self, name: str, path: Any, target: Any = None) -> Any:  # noqa: ARG002
        return importlib.util.spec_from_file_location(name, self.file, loader=self) if name == self.name else None

    def exec_module(self, module: Any) -> None:
        exec(self.code, module.__dict__)


class Chosen:
    """Pytest plugin: keeps the chosen tests, in their order."""

    def __init__(self, tests: list[str]) -> None:
        self.order = {test: k for k, test in enumerate(tests)}

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items[:] = sorted((i for i in items if i.nodeid in self.order), key=lambda i: self.order[i.nodeid])


class Watching:
    """Pytest plugin: which lines of the file each test reaches, and how long it takes."""

    def __init__(self, file: str) -> None:
        self.file, self.lines, self.seconds = file, {}, {}
        self.here: set[int] = set()

    def trace(self, frame: Any, event: str, argument: Any) -> Any:  # noqa: ARG002
        if frame.f_code.co_filename != self.file:
            return None
        self.here.add(frame.f_lineno)
        return self.trace

    def pytest_runtest_logstart(self) -> None:
        self.here, self.began = set(), time.process_time()
        threading.settrace(self.trace)  # for threads that the test starts
        sys.settrace(self.trace)

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        sys.settrace(None)
        threading.settrace(None)  # type: ignore[arg-type]
        self.lines[nodeid], self.seconds[nodeid] = sorted(self.here), time.process_time() - self.began


def pytest_run(files: list[str], plugins: list[Any]) -> int:
    import pytest

    options = ["-x", "-q", "-n0", "-p", "no:cacheprovider", "--timeout=0", "-o", "addopts=", "--import-mode=importlib"]
    options += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # plugins were imported before the fork
    return int(pytest.main([*options, *files], plugins=plugins))


def fork(work: Any) -> int:
    """Run a piece of work in a process of its own, silently; return its id."""
    sys.stdout.flush()
    if pid := os.fork():
        return pid
    os.setpgid(0, 0)
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    code = 3
    try:
        code = work()
    finally:
        os._exit(code)


class Room:
    """One core file with its tests."""

    def __init__(self, file: str, tests: list[str]) -> None:
        self.file = file
        self.path = ROOT / file
        self.module = "picoradar." + file.removesuffix(".py").replace("/", ".")
        self.tests = sorted(str(p.relative_to(ROOT)) for pattern in tests for p in ROOT.glob(pattern))
        source = self.path.read_text(encoding="utf-8")
        self.digest = hashlib.sha256(source.encode()).hexdigest()[:12]
        texts = b"".join((ROOT / test).read_bytes() for test in self.tests)
        self.tests_digest = hashlib.sha256(texts).hexdigest()[:12]
        self.mutants = mutants(source)

    def put(self, code: Any) -> None:
        """Let a changed module come when this one is imported."""
        sys.meta_path.insert(0, Changed(self.module, self.path, code))

    def baseline(self) -> None:
        """Run the true file once: which tests reach which lines. Then import here what is not ours."""
        found = ROOT / ".venv" / f"mutation-{os.getpid()}.json"

        def work() -> int:
            code = compile(self.path.read_text(encoding="utf-8"), str(self.path), "exec")
            self.put(code)
            seen = Watching(str(self.path))
            if code := pytest_run(self.tests, [seen]):
                return code
            ours = ("picoradar", "tests", "conftest", "__main__")
            others = [name for name in sys.modules if not name.startswith(ours)]
            found.write_text(json.dumps([seen.lines, seen.seconds, others]))
            return 0

        _, status = os.waitpid(fork(work), 0)
        if status:
            raise SystemExit(f"{self.file}: its tests fail without any change: pytest {' '.join(self.tests)}")
        self.lines, self.seconds, others = json.loads(found.read_text())
        found.unlink()
        for name in others:
            try:
                importlib.import_module(name)
            except Exception:  # noqa: BLE001  (what cannot be imported alone is imported by the tests)
                continue
        _, status = os.waitpid(self.start(None)[0], 0)
        if status:
            raise SystemExit(f"{self.file}: its tests fail in a forked process without any change")

    def start(self, mutant: Mutant | None) -> tuple[int, float]:
        """Begin to try a mutant, or the true file; return the process and when it must have ended."""
        span = set(range(mutant.line, mutant.last_line + 1)) if mutant else set()
        reached = [t for t, lines in self.lines.items() if not (mutant and mutant.in_body) or span & set(lines)]
        reached.sort(key=self.seconds.__getitem__)
        limit = LIMIT_S + LIMIT_TIMES * sum(self.seconds[t] for t in reached)

        def work() -> int:
            tree = mutant.make() if mutant else self.path.read_text(encoding="utf-8")
            self.put(compile(tree, str(self.path), "exec"))
            return pytest_run(self.tests, [Chosen(reached)])

        return fork(work), time.monotonic() + limit

    def run(self, count: int, jobs: int, done: set[int]) -> Iterator[dict[str, Any]]:
        """Try a sample; what is done is left out."""
        left = [k for k in sampled(self.mutants, self.file, count) if k not in done]
        if not left:
            return
        self.baseline()
        running: dict[int, tuple[int, float]] = {}
        while left or running:
            while left and len(running) < jobs:
                pid, end = self.start(self.mutants[left[0]])
                running[pid] = left.pop(0), end
            pid, status = os.waitpid(-1, os.WNOHANG)
            for late in [p for p, (_, end) in running.items() if time.monotonic() > end and p != pid]:
                os.killpg(late, signal.SIGKILL)
                running[late] = running[late][0], float("inf")
            if not pid:
                time.sleep(0.02)
                continue
            number, _ = running.pop(pid)
            m = self.mutants[number]
            code = os.waitstatus_to_exitcode(status)  # 0: all passed; 5: no test reaches these lines
            what = {"function": m.function, "line": m.at, "change": m.change, "killed": code not in (0, UNREACHED)}
            yield {"file": self.file, "source": self.digest, "tests": self.tests_digest, "mutant": number, **what}
