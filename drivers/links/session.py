"""What the sessions of all serial instruments share: one link, closing in the safe state, resynchronising."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from picoradar.drivers.errors import ProtocolError
from picoradar.drivers.links.serial import SerialLink

LATE_S = 0.1  # a reply that comes later than this after a failure is not waited for

T = TypeVar("T")


class SerialSession:
    """Base of the drivers of serial instruments.

    Parameters
    ----------
    link : SerialLink
        The line to the instrument; owned by this object from now on.
    """

    def __init__(self, link: SerialLink) -> None:
        self.link = link
        self._synchronised = True  # False after a failure: late replies may still come

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

    def _open_line(self, line_end: bytes, *, quiet_s: float = LATE_S) -> None:
        """Open the line, end a half-sent message of an earlier program, and drop what comes back."""
        self.link.open()
        self.link.write(line_end)
        self.link.drain(quiet_s=quiet_s)
        self._synchronised = True

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
