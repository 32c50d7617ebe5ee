"""Runs commands in a process that watches itself: what is opened for writing, loaded, started or connected to.

    python watched.py CASES.json

CASES.json is a list of ``{"name": ..., "command": [...]}``; a command that begins with ``python:`` calls that function
of this file with the rest. Printed is a JSON list of ``{"name", "status", "events"}``. Audit hooks (PEP 578) cannot be
taken away again, hence a process of its own; imports are done before, so that they are not taken for acts of a file.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import json
import os
import socket
import sqlite3
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
PATHS = ("os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.truncate", "os.chmod", "os.link", "os.symlink")
STARTS = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.startfile")

watching: list[list[str]] | None = None


def hook(event: str, arguments: tuple[object, ...]) -> None:
    if watching is None:
        return
    if event == "open":
        path, _mode, flags = arguments
        if isinstance(flags, int) and flags & WRITING and not isinstance(path, int):
            watching.append(["write", os.path.abspath(os.fsdecode(path))])  # type: ignore[arg-type]
    elif event in PATHS or event.startswith("shutil."):
        watching.extend(["write", os.path.abspath(os.fsdecode(a))] for a in arguments if isinstance(a, str | bytes))
    elif event == "sqlite3.connect":
        if "mode=ro" not in str(arguments[0]):
            watching.append(["write", str(arguments[0]).removeprefix("file://").split("?")[0]])
    elif event in ("socket.connect", "socket.sendto", "socket.bind"):
        watching.append(["connect", str(arguments[1])])
    elif event == "ctypes.dlopen":
        watching.append(["load", str(arguments[0])])
    elif event == "import":
        if str(arguments[0]).startswith("evil"):
            watching.append(["load", str(arguments[0])])
    elif event in STARTS or event == "pickle.find_class":
        watching.append(["start", f"{event} {arguments[:2]}"])


def provoke(folder: str) -> None:
    """Do what is looked for, so that the watching itself is tested."""
    Path(folder, "written").write_text("x")
    os.rename(Path(folder, "written"), Path(folder, "renamed"))
    sqlite3.connect(Path(folder, "made.db")).close()
    with contextlib.suppress(OSError):
        ctypes.CDLL(str(Path(folder, "evil.so")))
    with contextlib.suppress(OSError):
        socket.create_connection(("127.0.0.1", 9), timeout=1).close()
    with contextlib.suppress(ImportError):
        __import__("evil_module")
    os.system("true")


def replay(path: str) -> None:
    """Replay a transcript."""
    from picoradar.sim.replay import ReplayedBench

    with contextlib.suppress(ValueError), ReplayedBench(Path(path)) as bench:
        bench.urls  # noqa: B018


CALLS: dict[str, Callable[..., None]] = {"python:provoke": provoke, "python:replay": replay}


def status_of(command: list[str]) -> object:
    from picoradar.instrument.cli.main import run

    if command[0] in CALLS:
        return CALLS[command[0]](*command[1:])
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            return run(command)
        except BaseException as error:  # noqa: BLE001
            return f"{type(error).__name__}: {error}"


def main() -> None:
    global watching
    warnings.simplefilter("ignore")
    cases = json.loads(Path(sys.argv[1]).read_text())
    for case in cases:
        if case["name"].startswith("warm up"):
            case["status"], case["events"] = status_of(case["command"]), []
    sys.addaudithook(hook)
    for case in cases:
        if not case["name"].startswith("warm up"):
            watching = []
            case["status"], case["events"] = status_of(case["command"]), watching
            watching = None
    sys.stdout.write(json.dumps(cases))


if __name__ == "__main__":
    main()
