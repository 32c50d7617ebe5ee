"""Commands to a TC200 and its answers, matched by the echo of each command (protocol sheet ``thorlabs_tc200``)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from picoradar.drivers.errors import DeviceFault, ProtocolError
from picoradar.drivers.links import LATE_S, SerialSession
from picoradar.drivers.links.retry import retry
from picoradar.drivers.tc200.wire import PROMPT, encode, refusal_in, split_answer

LONGEST_ANSWER = 512
TRIES = 3

T = TypeVar("T")


class Tc200Session(SerialSession):
    """What all commands of the controller share."""

    def command(self, text: str) -> None:
        """Send a command that has no answer of its own.

        Raises
        ------
        DeviceFault
            When the controller refuses it; ``code`` is the controller's.
        """
        self._check(text, self.query(text))

    def query(self, text: str) -> str:
        """Send one command and get its answer, matched by the echo; two retries if it ends with ``?``.

        Raises
        ------
        Timeout, ProtocolError, LinkLost
            When no answer came, or none of the expected form.
        """
        return retry(TRIES if text.endswith("?") else 1, lambda: self._exchange(text))

    def _read(self, text: str, parse: Callable[[str], T], expected: str) -> T:
        """Query a value, and parse the answer."""
        answer = self.query(text)
        self._check(text, answer)
        return self._parsed(answer, text, parse, expected)

    def _check(self, text: str, answer: str) -> None:
        if (code := refusal_in(answer)) is not None:
            raise DeviceFault(self.device, f"refused {text}: {code}", code=code)

    def _exchange(self, text: str) -> str:
        if not self._synchronised:
            self.link.drain(quiet_s=LATE_S)
        self._synchronised = False
        self.link.write(encode(text))

        def match(received: bytes) -> str | None:
            try:
                echo, answer = split_answer(received)
            except ValueError as error:
                raise ProtocolError(self.device, f"unreadable answer: {error}", "check the baud rate") from error
            return answer if echo.strip() == text else None

        answer = self.link.read_match(PROMPT, match, limit=LONGEST_ANSWER)
        self._synchronised = True
        return answer
