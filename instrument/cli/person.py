"""`Person`: questions to the person at the terminal, who may need time, mistype, or want to stop."""

from __future__ import annotations

import queue
import sys
import threading
from collections.abc import Callable
from typing import TextIO

from picoradar.instrument.errors import BadInput, Interrupted

Wait = Callable[[Callable[[], bool]], None]
STOP = ("q", "quit", "stop")


class Person:
    """Asks on stderr and reads the answers, a line each, from a stream.

    A thread reads the lines, so that the caller can keep monitoring the bench: heartbeat, interlocks, Ctrl-C.

    Parameters
    ----------
    wait : callable
        Called with a condition; returns when it holds, or raises to stop.
    answers : text stream, optional
        stdin by default.
    """

    def __init__(self, wait: Wait, answers: TextIO | None = None) -> None:
        self._wait = wait
        self._answers = sys.stdin if answers is None else answers
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._reader: threading.Thread | None = None

    def ask(self, question: str, wait: Wait | None = None) -> str:
        """Ask, and return the answer without surrounding blanks.

        Parameters
        ----------
        question : str
        wait : callable, optional
            As in the constructor, for this question.

        Raises
        ------
        Interrupted
            When the person wants to stop.
        BadInput
            When the input has ended.
        """
        if self._reader is None:
            self._reader = threading.Thread(target=self._read, name="answers", daemon=True)
            self._reader.start()
        sys.stderr.write(f"{question}\n")
        sys.stderr.flush()
        (wait or self._wait)(lambda: not self._lines.empty())
        line = self._lines.get()
        if not line:
            self._lines.put("")  # so that the next question finds the end again
            raise BadInput("no answer: this procedure needs a person at the terminal; run it in a terminal")
        answer = line.strip()
        if answer.lower() in STOP:
            raise Interrupted("stopped by the person at the bench")
        return answer

    def numbers(
        self,
        question: str,
        allowed: tuple[tuple[float, float], ...],
        default: tuple[float, ...] | None = None,
        wait: Wait | None = None,
    ) -> tuple[float, ...]:
        """Ask for numbers separated by commas; repeat until their count is right and each is within its bounds.

        Parameters
        ----------
        allowed : tuple of (float, float)
            Minimum and maximum of each.
        default : tuple of float, optional
            What an empty answer means.
        """
        while True:
            answer = self.ask(question, wait)
            if not answer and default is not None:
                return default
            try:
                found = tuple(float(part) for part in answer.split(","))
            except ValueError:
                found = ()
            if len(found) == len(allowed) and all(a <= x <= b for x, (a, b) in zip(found, allowed, strict=True)):
                return found
            form = ", ".join(f"a number from {minimum:g} to {maximum:g}" for minimum, maximum in allowed)
            sys.stderr.write(f"{answer!r} cannot be used: give {form}; or q to stop\n")

    def _read(self) -> None:
        for line in self._answers or ():  # Python has no stdin where it was closed before the start
            self._lines.put(line)
        self._lines.put("")
