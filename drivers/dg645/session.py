"""Lines to and from a DG645: questions, blocks of set commands, the error queue, and getting back in step.

Set commands give no reply, so every block of them ends with ``LERR?`` (protocol sheet ``dg645``).
"""

from __future__ import annotations

from picoradar.drivers.dg645.wire import ERRORS, QUEUE_LENGTH, REPLY_END, decode, encode, format_number
from picoradar.drivers.errors import DeviceFault, ProtocolError
from picoradar.drivers.links import SerialLink, read_number
from picoradar.drivers.links.retry import retry

LONGEST_REPLY = 256
TRIES = 3
CLEARED_BY_READING = ("LERR?", "INSR?", "*ESR?")
LATE_S = 0.1  # a reply that comes later than this after a failure is not waited for


class Dg645Session:
    """What all commands of the instrument share.

    Parameters
    ----------
    link : SerialLink
        The line to it; owned by this object from now on.
    """

    def __init__(self, link: SerialLink) -> None:
        self.link = link
        self._in_step = True  # False after a failure: late replies may still come

    @property
    def device(self) -> str:
        """Get the device's name for messages."""
        return self.link.device

    def query(self, text: str) -> str:
        """Ask one question and get the text of the reply; two retries, unless asking changes what is asked for.

        Raises
        ------
        Timeout, ProtocolError, LinkLost
            When no reply, or none in its form, came.
        """
        tries = 1 if text.startswith(CLEARED_BY_READING) else TRIES
        return retry(tries, lambda: self._exchange(text))

    def configure(self, *commands: str) -> None:
        """Send a block of set commands and make sure that every one was taken.

        Raises
        ------
        DeviceFault
            With the oldest code in the error queue and its meaning.
        """
        self._synchronise()
        for command in commands:
            self.link.write(encode(command))
        if codes := self.errors():
            meaning = "; ".join(f"{code} {ERRORS.get(code, 'unknown error')}" for code in codes)
            raise DeviceFault(self.device, f"refused {', '.join(commands)}: error {meaning}", code=codes[0])

    def errors(self) -> list[int]:
        """Get all codes of the error queue, oldest first; reading empties it.

        Raises
        ------
        ProtocolError
            When more codes come than the queue can hold.
        """
        codes: list[int] = []
        while (code := self.integer("LERR?", least=0, most=254)) != 0:
            codes.append(code)
            if len(codes) > QUEUE_LENGTH:
                raise ProtocolError(self.device, f"the error queue does not end; last code {code}")
        return codes

    def wait_complete(self) -> None:
        """Wait until all commands before this one have been carried out (``*OPC?``)."""
        self.integer("*OPC?", least=1, most=1)

    def status_byte(self) -> int:
        """Get the status byte (``*STB?``)."""
        return self.integer("*STB?", least=0, most=255)

    def standard_events(self) -> int:
        """Get the standard event register (``*ESR?``); reading clears it."""
        return self.integer("*ESR?", least=0, most=255)

    def get_number(self, key: str) -> float:
        """Ask for the number behind a mnemonic."""
        return self.number(f"{key}?")

    def set_number(self, key: str, value: float) -> None:
        """Set the number behind a mnemonic; checked by ``LERR?``."""
        self.configure(f"{key} {format_number(value)}")

    def number(self, query: str) -> float:
        """Ask a question to which the reply is a number."""
        text = self.query(query)
        try:
            return read_number(text)
        except ValueError as error:
            self._in_step = False
            raise ProtocolError(self.device, f"answered {text!r} to {query}, which is no number") from error

    def integer(self, query: str, *, least: int, most: int) -> int:
        """Ask a question to which the reply is an integer in a known range."""
        number = self.number(query)
        if not (least <= number <= most and number == int(number)):
            self._in_step = False
            what = f"answered {number:g} to {query}, which is no integer from {least} to {most}"
            raise ProtocolError(self.device, what)
        return int(number)

    def _exchange(self, text: str) -> str:
        self._synchronise()
        self.link.take_leftover()  # the instrument says nothing unasked: a rest of a spoilt reply
        self._in_step = False
        self.link.write(encode(text))
        line = self.link.read_until(REPLY_END, limit=LONGEST_REPLY)
        try:
            reply = decode(line)
        except ValueError as error:
            raise ProtocolError(self.device, f"unreadable reply: {error}", "check the baud rate") from error
        self._in_step = True
        return reply

    def _synchronise(self) -> None:
        """After a failure, drop what comes late: nothing before the answer to ``*IDN?`` counts.

        Errors that the failure left in the queue are dropped too: they are not the next command's.
        """
        if self._in_step:
            return
        self.link.drain(quiet_s=LATE_S)
        self.link.write(encode("") + encode("*IDN?"))
        self.link.read_match(REPLY_END, lambda line: (b",DG645," in line) or None, limit=LONGEST_REPLY)
        self.link.drain(quiet_s=LATE_S)
        self._in_step = True
        self.errors()
