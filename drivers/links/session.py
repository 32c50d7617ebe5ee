"""What the sessions of all serial instruments share: one link, closing in the safe state, resynchronising."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import TypeVar

from picoradar.drivers.errors import ProtocolError, Timeout
from picoradar.drivers.links.serial import SerialLink

# Answers take 10 to 100 ms at 9600 baud (sheets dg645, tdk_genesys). One asked for ahead is overdue just before the
# next heartbeat, which looks for it; asked for again it is waited for, and that must not hold up the heartbeat.
ANSWER_AHEAD_S = 0.24
ANSWER_AGAIN_S = 0.15
LATE_S = 0.1  # a reply that comes later than this after a failure is not waited for

T = TypeVar("T")


class SerialSession:
    """Base of the drivers of serial instruments.

    Parameters
    ----------
    link : SerialLink
        The line to the instrument; owned by this object from now on.

    Attributes
    ----------
    found_on : tuple of str
        What was on when it was opened, before it was switched off.
    """

    found_on: tuple[str, ...] = ()

    def __init__(self, link: SerialLink) -> None:
        self.link = link
        self._synchronised = True  # False after a failure: late replies may still come
        self._asked_ahead_s: float | None = None
        self._asked_twice = False  # two answers may come to the one that was wanted

    @property
    def device(self) -> str:
        """Get the device's name for messages."""
        return self.link.device

    def close(self) -> None:
        """Bring the device into its safe state and close the line; harmless when it is closed or has vanished.

        Raises
        ------
        DeviceError
            When the safe state could not be verified; the line is closed all the same.
        """
        try:
            if self.link.is_open:
                self._make_safe()
        finally:
            self.link.close()

    def _make_safe(self) -> None:
        """Switch off what the device drives, and verify it."""
        raise NotImplementedError

    def _ask_ahead(self, message: bytes, end: bytes, read: Callable[[bytes], T | None]) -> T | None:
        """Ask without waiting, or read the answer to what was asked before; None while it is under way.

        An answer that is overdue or damaged is asked for once more, and waited for this time.

        Parameters
        ----------
        message, end : bytes
            The question, and what ends a line.
        read : callable
            Reads a line; raises `ValueError`, `KeyError` or `ProtocolError` for what is no answer, or returns None.

        Raises
        ------
        Timeout
            When the second question is not answered either, within `ANSWER_AGAIN_S`.
        LinkLost, ProtocolError
        """
        now_s, patience_s = self.link.clock.now(), self.link.clock.patience_s
        if self._asked_ahead_s is None:
            self._resynchronise()
            self.link.take_leftover()
            self._asked_ahead_s, self._synchronised = now_s, False  # before it is sent: whatever comes between
            self.link.write(message)
            return None

        def readable(line: bytes) -> T | None:
            with contextlib.suppress(ValueError, KeyError, ProtocolError):
                return read(line)
            return None

        line = self.link.take_line(end)
        if line is None and now_s - self._asked_ahead_s < patience_s(ANSWER_AHEAD_S):
            return None
        self._asked_ahead_s = None
        found = readable(line) if line is not None else None
        if found is None:
            self.link.take_leftover()
            self._asked_twice = True
            self.link.write(message)
            found = self.link.read_match(end, readable, timeout_s=patience_s(ANSWER_AGAIN_S))
        self._synchronised = True
        return found

    def _take_answer_ahead(self, end: bytes, read: Callable[[bytes], object | None]) -> None:
        """Before another exchange, wait for what was asked ahead and drop it; a lost answer is resynchronised later.

        Parameters
        ----------
        end : bytes
            What ends a line.
        read : callable
            Reads a line; returns None for one that is no answer, and is waited through.
        """
        if self._asked_ahead_s is not None:
            self._asked_ahead_s = None
            with contextlib.suppress(Timeout, ProtocolError):
                self.link.read_match(end, read, timeout_s=self.link.clock.patience_s(ANSWER_AHEAD_S))
                self._synchronised = True
        if self._asked_twice:
            self._asked_twice = self._synchronised = False

    def _resynchronise(self) -> None:
        """After a failure, find the beginning of the next answer again."""
        raise NotImplementedError

    def _open_line(self, line_end: bytes, *, quiet_s: float = LATE_S) -> None:
        """Open the line, end a half-sent message of an earlier program, and drop what comes back."""
        self.link.open()
        self.link.write(line_end)
        self.link.drain(quiet_s=quiet_s)
        self._synchronised, self._asked_ahead_s, self._asked_twice = True, None, False

    def _parsed(self, reply: str, query: str, parse: Callable[[str], T], expected: str) -> T:
        """Parse a reply; one that is not what was asked for may belong to another query.

        Raises
        ------
        ProtocolError
            When ``parse`` raises `ValueError` or `KeyError`.
        """
        try:
            return parse(reply)
        except (KeyError, ValueError) as error:
            raise self._unexpected(reply, query, expected) from error

    def _unexpected(self, reply: str, query: str, expected: str) -> ProtocolError:
        """Make the error of a reply that has not the expected form; resynchronise before the next query."""
        self._synchronised = False
        return ProtocolError(self.device, f"answered {reply!r} to {query}, which is not {expected}")
