"""Messages to a Genesys supply and its replies: address, check sum, retries, and resynchronising.

Every message gets one reply; a refusal is such a reply. Unsolicited messages of the supply (``!nn``) are separated from
the replies and counted (protocol sheet ``tdk_genesys``).
"""

from __future__ import annotations

from picoradar.drivers.errors import DeviceFault, ProtocolError, check_range
from picoradar.drivers.genesys.wire import END, ERRORS, decode, encode, format_number, unsolicited_from
from picoradar.drivers.links import LATE_S, SerialLink, SerialSession, read_number
from picoradar.drivers.links.retry import retry

ANSWER_S = 0.5
TRIES = 3
LONGEST_REPLY = 256
CORRUPTED = ("C01", "C04")  # the driver sends only valid messages: these replies mean damage on the line
SWITCHES = ("OUT", "AST", "FLD")
SWITCH = {"ON": 1, "OFF": 0}


class GenesysSession(SerialSession):
    """What all commands of the supply share.

    Parameters
    ----------
    link : SerialLink
        The line to it; owned by this object from now on.
    address : int
        Address on the line, 0 to 30.
    checksum : bool
        Whether messages carry a check sum; replies then carry one too.

    Attributes
    ----------
    unsolicited : int
        Unsolicited messages so far (``!nn``): some enabled event bit was set.
    """

    def __init__(self, link: SerialLink, address: int = 6, *, checksum: bool = False) -> None:
        check_range(link.device, "address", address, 0, 30)
        super().__init__(link)
        self.address = address
        self.checksum = checksum
        self.unsolicited = 0

    def query(self, text: str) -> str:
        """Send one message and get the text of its reply; two retries when none comes.

        Raises
        ------
        DeviceFault
            With the supply's error code and its meaning.
        Timeout, ProtocolError, LinkLost
            When no reply came, or none of the expected form.
        """
        reply = retry(TRIES, lambda: self._understood(text))
        if reply in ERRORS:
            raise DeviceFault(self.device, f"refused {text}: {reply}, {ERRORS[reply]}", code=reply)
        return reply

    def command(self, text: str) -> None:
        """Send a set command and make sure that the supply says ``OK``.

        Raises
        ------
        DeviceFault
            When the supply refuses it; ``code`` is the supply's.
        ProtocolError
            When it answers something else.
        """
        reply = self.query(text)
        if reply != "OK":
            raise self._unexpected(reply, text, "OK")

    def get_number(self, key: str) -> float:
        """Query the number of a mnemonic; 1 and 0 for a switch that is ``ON`` or ``OFF``."""
        query = f"{key}?"
        if key in SWITCHES:
            return self._parsed(self.query(query), query, lambda text: float(SWITCH[text]), "ON or OFF")
        return self._parsed(self.query(query), query, read_number, "a number")

    def set_number(self, key: str, value: float) -> None:
        """Set the number of a mnemonic."""
        self.command(f"{key} {format_number(value)}")

    def get_register(self, key: str) -> int:
        """Query the register (two hex digits) of a mnemonic.

        Raises
        ------
        ProtocolError
            When the reply is not two hex digits.
        """
        text = self.query(f"{key}?")
        if len(text) != 2 or text.strip("0123456789ABCDEF"):
            raise self._unexpected(text, f"{key}?", "two hex digits")
        return int(text, 16)

    def output_answers(self) -> bool | None:
        """Ask for the output without waiting; returns whether it is on once the answer has come.

        For a regular look under light: it costs no time, and shows within a second that the line has gone.

        Raises
        ------
        Timeout, ProtocolError, LinkLost
            When no answer comes, also not when it is asked for again, or the port has vanished.
        """

        def read(line: bytes) -> bool | None:
            text = self._solicited(line)
            return None if text is None else bool(SWITCH[text])

        return self._ask_ahead(encode("OUT?", with_checksum=self.checksum), END, read)

    def _understood(self, text: str) -> str:
        """Exchange one message; one that was corrupted on its way to the supply counts as a corrupted reply."""
        self._take_answer_ahead(END, self._solicited)
        self._resynchronise()
        self._synchronised = False
        reply = self._exchange(text)
        if reply in CORRUPTED:
            raise ProtocolError(self.device, f"did not understand {text}: {reply}, {ERRORS[reply]}")
        self._synchronised = True
        return reply

    def _exchange(self, text: str) -> str:
        for line in self.link.take_leftover().split(END):
            if line.startswith(b"!"):
                self.unsolicited += 1
        self.link.write(encode(text, with_checksum=self.checksum))
        return self.link.read_match(END, self._solicited, timeout_s=ANSWER_S, limit=LONGEST_REPLY)

    def _solicited(self, line: bytes) -> str | None:
        """Get the text of a reply; None for an unsolicited message."""
        try:
            text = decode(line, with_checksum=self.checksum and not line.startswith(b"!"))
        except ValueError as error:
            raise ProtocolError(self.device, f"unreadable reply: {error}", "check the baud rate") from error
        if unsolicited_from(text) is None:
            return text
        self.unsolicited += 1
        return None

    def _resynchronise(self) -> None:
        """After a failure, drop all that still comes up to the answer to ``IDN?``."""
        if self._synchronised:
            return
        self.link.drain(quiet_s=LATE_S)
        self._exchange(f"ADR {self.address}")
        self.link.write(encode("IDN?", with_checksum=self.checksum))
        self.link.read_match(END, self._identity, timeout_s=ANSWER_S, limit=LONGEST_REPLY)
        self.link.drain(quiet_s=LATE_S)
        self._synchronised = True

    def _identity(self, line: bytes) -> str | None:
        text = self._solicited(line)
        return text if text is not None and text.startswith(("LAMBDA", "TDK")) else None
