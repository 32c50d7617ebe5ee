"""Lines to and from a DG645: queries, blocks of set commands, the error queue, and resynchronising.

Set commands give no reply, so every block of them ends with ``LERR?`` (protocol sheet ``dg645``).
"""

from __future__ import annotations

from picoradar.drivers.dg645.wire import (
    ERRORS,
    QUEUE_LENGTH,
    REPLY_END,
    TriggerSource,
    decode,
    encode,
    format_number,
)
from picoradar.drivers.errors import DeviceFault, ProtocolError
from picoradar.drivers.links import LATE_S, SerialSession, read_number
from picoradar.drivers.links.retry import retry

LONGEST_REPLY = 256
TRIES = 3
CLEARED_BY_READING = ("LERR?", "INSR?", "*ESR?")


class Dg645Session(SerialSession):
    """What all commands of the instrument share."""

    def query(self, text: str) -> str:
        """Send one query and get the text of the reply; two retries, unless the query itself changes what it reads.

        Raises
        ------
        Timeout, ProtocolError, LinkLost
            When no reply came, or none of the expected form.
        """
        tries = 1 if text.startswith(CLEARED_BY_READING) else TRIES
        return retry(tries, lambda: self._exchange(text))

    def configure(self, *commands: str) -> None:
        """Send a block of set commands and make sure that every one was accepted.

        Raises
        ------
        DeviceFault
            With the oldest code in the error queue and its meaning.
        """
        self._take_answer_ahead(REPLY_END, lambda line: line)
        self._resynchronise()
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
        while (code := self.integer("LERR?", minimum=0, maximum=254)) != 0:
            codes.append(code)
            if len(codes) > QUEUE_LENGTH:
                raise ProtocolError(self.device, f"the error queue does not end; last code {code}")
        return codes

    def wait_complete(self) -> None:
        """Wait until all commands before this one have been carried out (``*OPC?``)."""
        self.integer("*OPC?", minimum=1, maximum=1)

    def status_byte(self) -> int:
        """Get the status byte (``*STB?``)."""
        return self.integer("*STB?", minimum=0, maximum=255)

    def standard_events(self) -> int:
        """Get the standard event register (``*ESR?``); reading clears it."""
        return self.integer("*ESR?", minimum=0, maximum=255)

    def get_number(self, key: str) -> float:
        """Query the number of a mnemonic."""
        return self.number(f"{key}?")

    def set_number(self, key: str, value: float) -> None:
        """Set the number of a mnemonic; checked by ``LERR?``."""
        self.configure(f"{key} {format_number(value)}")

    def number(self, query: str) -> float:
        """Send a query whose reply is a number."""
        return self._parsed(self.query(query), query, read_number, "a number")

    def integer(self, query: str, *, minimum: int, maximum: int) -> int:
        """Send a query whose reply is an integer in a known range.

        Parameters
        ----------
        query : str
        minimum, maximum : int
            Range of the reply.

        Raises
        ------
        ProtocolError
            When the reply is not an integer in that range.
        """
        number = self.number(query)
        if not (minimum <= number <= maximum and number == int(number)):
            raise self._unexpected(f"{number:g}", query, f"an integer from {minimum} to {maximum}")
        return int(number)

    def triggers_answer(self) -> bool | None:
        """Ask for the trigger source without waiting; returns whether it is the internal one once the answer has come.

        For a regular look under light: it costs no time, and shows within a second that the line has gone.

        Raises
        ------
        Timeout, ProtocolError, LinkLost
            When no answer comes, also not when it is asked for again, or the port has vanished.
        """
        return self._ask_ahead(encode("TSRC?"), REPLY_END, lambda line: int(decode(line)) == TriggerSource.INTERNAL)

    def _exchange(self, text: str) -> str:
        self._take_answer_ahead(REPLY_END, lambda line: line)
        self._resynchronise()
        self.link.take_leftover()  # the instrument sends nothing unasked: this is left over from a corrupted reply
        self._synchronised = False
        self.link.write(encode(text))
        line = self.link.read_until(REPLY_END, limit=LONGEST_REPLY)
        try:
            reply = decode(line)
        except ValueError as error:
            raise ProtocolError(self.device, f"unreadable reply: {error}", "check the baud rate") from error
        self._synchronised = True
        return reply

    def _resynchronise(self) -> None:
        """After a failure, drop all that still comes up to the answer to ``*IDN?``.

        Errors that the failure left in the queue are dropped too: they do not belong to the next command.
        """
        if self._synchronised:
            return
        self.link.drain(quiet_s=LATE_S)
        self.link.write(encode("") + encode("*IDN?"))
        self.link.read_match(REPLY_END, lambda line: (b",DG645," in line) or None, limit=LONGEST_REPLY)
        self.link.drain(quiet_s=LATE_S)
        self._synchronised = True
        self.errors()
