"""Messages to a Genesys supply and its replies: address, check sum, retries, and getting back in step.

Every message gets one reply, and a refusal is that reply. Messages that the supply sends by itself (``!nn``)
are sorted out and counted (protocol sheet ``tdk_genesys``).
"""

from __future__ import annotations

from picoradar.drivers.errors import DeviceFault, ProtocolError, check_range
from picoradar.drivers.genesys.wire import END, ERRORS, decode, encode, format_number, unsolicited_from
from picoradar.drivers.links import SerialLink, read_number
from picoradar.drivers.links.retry import retry

ANSWER_S = 0.5
TRIES = 3
LATE_S = 0.1  # a reply that comes later than this after a failure is not waited for
LONGEST_REPLY = 256
SPOILT = ("C01", "C04")  # to what the driver sends, the answers to a message damaged on the line
SWITCHES = ("OUT", "AST", "FLD")
SWITCH = {"ON": 1, "OFF": 0}


class GenesysSession:
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
        Messages that came unasked (``!nn``): some enabled event bit was set.
    """

    def __init__(self, link: SerialLink, address: int = 6, checksum: bool = False) -> None:
        check_range(link.device, "address", address, 0, 30)
        self.link = link
        self.address = address
        self.checksum = checksum
        self.unsolicited = 0
        self._in_step = True  # False after a failure: late replies may still come

    @property
    def device(self) -> str:
        """Get the device's name for messages."""
        return self.link.device

    def query(self, text: str) -> str:
        """Send one message and get the text of its reply; two retries when none comes.

        Raises
        ------
        DeviceFault
            With the supply's error code and its meaning.
        Timeout, ProtocolError, LinkLost
            When no reply, or none in its form, came.
        """
        reply = retry(TRIES, lambda: self._understood(text))
        if reply in ERRORS:
            raise DeviceFault(self.device, f"refused {text}: {reply}, {ERRORS[reply]}", code=reply)
        return reply

    def command(self, text: str) -> None:
        """Send a set command and make sure that the supply says ``OK``."""
        reply = self.query(text)
        if reply != "OK":
            self._in_step = False
            raise ProtocolError(self.device, f"answered {reply!r} to {text}, not OK")

    def get_number(self, key: str) -> float:
        """Ask for the number behind a mnemonic; 1 and 0 for a switch that is ``ON`` or ``OFF``."""
        text = self.query(f"{key}?")
        try:
            return float(SWITCH[text]) if key in SWITCHES else read_number(text)
        except (KeyError, ValueError) as error:
            self._in_step = False
            due = "ON or OFF" if key in SWITCHES else "a number"
            raise ProtocolError(self.device, f"answered {text!r} to {key}?, not {due}") from error

    def set_number(self, key: str, value: float) -> None:
        """Set the number behind a mnemonic."""
        self.command(f"{key} {format_number(value)}")

    def get_register(self, key: str) -> int:
        """Ask for the register (two hex digits) behind a mnemonic."""
        text = self.query(f"{key}?")
        if len(text) != 2 or text.strip("0123456789ABCDEF"):
            self._in_step = False
            raise ProtocolError(self.device, f"answered {text!r} to {key}?, not two hex digits")
        return int(text, 16)

    def _understood(self, text: str) -> str:
        """Exchange one message in step; a message that was spoilt on its way counts as a spoilt reply."""
        self._synchronise()
        self._in_step = False
        reply = self._exchange(text)
        if reply in SPOILT:
            raise ProtocolError(self.device, f"did not understand {text}: {reply}, {ERRORS[reply]}")
        self._in_step = True
        return reply

    def _exchange(self, text: str) -> str:
        for line in self.link.take_leftover().split(END):
            if line.startswith(b"!"):
                self.unsolicited += 1
        self.link.write(encode(text, with_checksum=self.checksum))
        return self.link.read_match(END, self._solicited, timeout_s=ANSWER_S, limit=LONGEST_REPLY)

    def _solicited(self, line: bytes) -> str | None:
        """Get the text of a reply; None for a message that came unasked."""
        try:
            text = decode(line, with_checksum=self.checksum and not line.startswith(b"!"))
        except ValueError as error:
            raise ProtocolError(self.device, f"unreadable reply: {error}", "check the baud rate") from error
        if unsolicited_from(text) is None:
            return text
        self.unsolicited += 1
        return None

    def _synchronise(self) -> None:
        """After a failure, drop what comes late: nothing before the answer to ``IDN?`` counts."""
        if self._in_step:
            return
        self.link.drain(quiet_s=LATE_S)
        self._exchange(f"ADR {self.address}")
        self.link.write(encode("IDN?", with_checksum=self.checksum))
        self.link.read_match(END, self._identity, timeout_s=ANSWER_S, limit=LONGEST_REPLY)
        self.link.drain(quiet_s=LATE_S)
        self._in_step = True

    def _identity(self, line: bytes) -> str | None:
        text = self._solicited(line)
        return text if text is not None and text.startswith(("LAMBDA", "TDK")) else None
