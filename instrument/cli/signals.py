"""Signals that end a program: Ctrl-C, Ctrl-\\, a closed terminal, a lost connection, a service manager, a log-off.

All end it the same way: the radar is brought to its safe state, the recording is closed with its cause, the exit status
is that of an interruption.
"""

from __future__ import annotations

import contextlib
import os
import signal
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from picoradar.instrument.controller import Controller

NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK")
ENDING = tuple(signal.Signals[name] for name in NAMES if hasattr(signal, name))
STREAMS = (0, 1, 2)

Handler = Callable[[int, FrameType | None], object]


def handle(handler: Handler | signal.Handlers) -> dict[signal.Signals, object]:
    """Install a handler for every signal that ends a program; returns those before.

    A hang-up that is ignored stays ignored: ``nohup`` asks for that.
    """
    before: dict[signal.Signals, object] = {}
    for number in ENDING:
        if number.name == "SIGHUP" and signal.getsignal(number) is signal.SIG_IGN:
            continue
        before[number] = signal.signal(number, handler)
    return before


def interrupt_from_now_on() -> None:
    """Let the first signal raise `KeyboardInterrupt`; for work outside of a session, where the laser cannot be on."""

    def interrupt(number: int, _frame: FrameType | None) -> None:
        ignore_from_now_on()
        leave_terminal(number)
        raise KeyboardInterrupt

    handle(interrupt)


def ignore_from_now_on() -> None:
    """Let no signal change how the program ends."""
    handle(signal.SIG_IGN)


@contextmanager
def asking(controller: Controller) -> Iterator[list[str]]:
    """Let the first signal ask the controller to end safely, and the second for an emergency off.

    Yields
    ------
    list of str
        Names of the signals that came.
    """
    came: list[str] = []

    def ask(number: int, _frame: FrameType | None) -> None:
        came.append(signal.Signals(number).name)
        leave_terminal(number)
        controller.request("interrupt" if len(came) == 1 else "emergency off")

    before = handle(ask)
    try:
        with _console_close(ask):
            yield came
    finally:
        for number, handler in before.items():
            # Once a person has asked to stop, the safe shutdown runs to its end: more signals change nothing.
            signal.signal(number, signal.SIG_IGN if came else handler)  # type: ignore[arg-type]


def leave_terminal(number: int) -> None:
    """Send what is still written to nowhere when the terminal has gone: writing to it would fail in mid-shutdown."""
    if signal.Signals(number).name != "SIGHUP":
        return
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in STREAMS:
        with contextlib.suppress(OSError):
            # A terminal that was hung up no longer says that it is one; it still is a character device.
            if stat.S_ISCHR(os.fstat(stream).st_mode):
                os.dup2(nowhere, stream)
    os.close(nowhere)


@contextmanager
def _console_close(ask: Handler) -> Iterator[None]:
    """On Windows, hold the end of the process that follows a closed console or a log-off until the block has ended.

    Windows ends a process as soon as its handler returns (after 5 s at the latest); the runtime's own handler, which
    makes ``SIGBREAK`` of it, returns at once.
    """
    if os.name != "nt":
        yield
        return
    import ctypes
    import threading

    api: Any = ctypes  # has these names on Windows only
    left = threading.Event()
    closing = {2, 5, 6}  # CTRL_CLOSE_EVENT, CTRL_LOGOFF_EVENT, CTRL_SHUTDOWN_EVENT: SetConsoleCtrlHandler, wincon.h

    def closed(event: int) -> bool:
        if event not in closing:
            return False
        ask(signal.SIGTERM, None)
        left.wait(5.0)
        return True

    routine = api.WINFUNCTYPE(ctypes.c_int, ctypes.c_uint)(closed)
    api.windll.kernel32.SetConsoleCtrlHandler(routine, 1)
    try:
        yield
    finally:
        left.set()
        api.windll.kernel32.SetConsoleCtrlHandler(routine, 0)
