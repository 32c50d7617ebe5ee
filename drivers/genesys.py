"""TDK-Lambda Genesys programmable DC supply: drive voltage of the laser pulser (protocol sheet ``tdk_genesys``).

Every message gets one reply, and a refusal is that reply. Messages that the supply sends by itself (``!nn``)
are sorted out and counted. The supply has no watchdog: a lost host is covered by its ENA terminals.
"""

from __future__ import annotations

from drivers.controls import Control, Reading
from drivers.errors import DeviceFault, ProtocolError, Timeout, check_range
from drivers.genesys_wire import (
    END,
    ERRORS,
    Fault,
    Look,
    Status,
    decode,
    encode,
    format_number,
    parse_look,
    parse_rating,
    unsolicited_from,
)
from drivers.interfaces import Identity
from drivers.serial_link import SerialLink

BAUD = 9600
ANSWER_S = 0.5
TRIES = 3


class Genesys:
    """One supply on a serial line (RS-232, or one of up to 31 on RS-485).

    Parameters
    ----------
    link : SerialLink
        The line to it; owned by this object from now on.
    address : int
        Address on the line, 0 to 30 (6 as shipped).
    checksum : bool
        Whether messages carry a check sum; replies then carry one too.

    Attributes
    ----------
    rated_v, rated_a : float
        Rating, known after `open` from the model name.
    unsolicited : int
        Messages that came unasked (``!nn``) since `open`: some enabled event bit was set.
    """

    def __init__(self, link: SerialLink, address: int = 6, checksum: bool = False) -> None:
        check_range(link.device, "address", address, 0, 30)
        self.link = link
        self.address = address
        self.checksum = checksum
        self.rated_v = 600.0
        self.rated_a = 1.3
        self.unsolicited = 0
        self._in_step = True  # False after a failure: late replies may still come

    @property
    def device(self) -> str:
        """Get the device's name for messages."""
        return self.link.device

    voltage_v: Control[str, float] = Control(
        "PV",
        float,
        "Control the voltage set point in V (float from 0 to 1.05 x rating, at most 0.95 x over-voltage trip).",
        limits=lambda supply: (0.0, 1.05 * supply.rated_v),
        unit="V",
    )
    current_a: Control[str, float] = Control(
        "PC",
        float,
        "Control the current limit in A (float from 0 to 1.05 x rating).",
        limits=lambda supply: (0.0, 1.05 * supply.rated_a),
        unit="A",
    )
    overvoltage_v: Control[str, float] = Control(
        "OVP",
        float,
        "Control the over-voltage trip in V (float from 5 to 1.1 x rating, at least 1.05 x set point).",
        limits=lambda supply: (5.0, 1.1 * supply.rated_v),
        unit="V",
    )
    undervoltage_v: Control[str, float] = Control(
        "UVL",
        float,
        "Control the least voltage set point in V (float from 0 to 0.95 x rating).",
        limits=lambda supply: (0.0, 0.95 * supply.rated_v),
        unit="V",
    )
    foldback_delay: Control[str, int] = Control(
        "FBD", int, "Control the foldback delay in 0.1 s, added to 0.25 s (int from 0 to 255).", limits=(0, 255)
    )
    filter_hz: Control[str, int] = Control(
        "FILTER", int, "Control the measuring filter in Hz (int: 18, 23 or 46).", limits=(18, 46), unit="Hz"
    )
    measured_v = Reading("MV", float, "Measure the output voltage in V.")
    measured_a = Reading("MC", float, "Measure the output current in A.")

    @property
    def output(self) -> bool:
        """Control whether the output is on (bool)."""
        return self._on_or_off("OUT")

    @output.setter
    def output(self, on: bool) -> None:
        self.command(f"OUT {on:d}")

    @property
    def auto_start(self) -> bool:
        """Control whether the output comes back by itself after mains return (bool; False on this bench)."""
        return self._on_or_off("AST")

    @auto_start.setter
    def auto_start(self, on: bool) -> None:
        self.command(f"AST {on:d}")

    @property
    def foldback(self) -> bool:
        """Control whether constant current shuts the output down (bool)."""
        return self._on_or_off("FLD")

    @foldback.setter
    def foldback(self, on: bool) -> None:
        self.command(f"FLD {on:d}")

    @property
    def remote(self) -> str:
        """Get who may operate it: ``LOC``, ``REM`` or ``LLO``."""
        return self.query("RMT?")

    @property
    def mode(self) -> str:
        """Get what the output does: ``CV``, ``CC`` or ``OFF``."""
        return self.query("MODE?")

    @property
    def fault(self) -> Fault:
        """Get the fault register as it is now."""
        return Fault(self._register("FLT?"))

    @property
    def status(self) -> Status:
        """Get the status register as it is now."""
        return Status(self._register("STAT?"))

    def fault_events(self) -> Fault:
        """Get the enabled faults since the last call; reading clears them."""
        return Fault(self._register("FEVE?"))

    def status_events(self) -> Status:
        """Get the enabled status changes since the last call; reading clears them."""
        return Status(self._register("SEVE?"))

    def enable_events(self, faults: Fault, status: Status) -> None:
        """Control which bits make an event and an unsolicited message."""
        self.command(f"FENA {faults:02X}")
        self.command(f"SENA {status:02X}")

    def look(self) -> Look:
        """Measure set points, output and both registers in one exchange (``STT?``)."""
        text = self.query("STT?")
        try:
            return parse_look(text)
        except ValueError as error:
            raise ProtocolError(self.device, str(error)) from error

    def open(self) -> None:
        """Open the line, choose the unit, take remote control, and switch output and auto-start off.

        Raises
        ------
        LinkLost, Timeout
            When the line or the device is not there.
        ProtocolError
            When another device answers.
        DeviceFault
            When the output cannot be verified off.
        """
        self.link.open()
        self.unsolicited = 0
        self.link.write(END)  # ends a half message that an earlier program may have left
        self.link.drain(quiet_s=0.1)
        self._in_step = True
        self.command(f"ADR {self.address}")
        self.rated_v, self.rated_a = self._rating(self.query("IDN?"))
        self.command("RMT 1")
        self.auto_start = False
        self.switch(on=False)

    def close(self) -> None:
        """Switch the output off, set 0 V and close the line; harmless when it is closed or has vanished.

        Raises
        ------
        DeviceError
            When the output could not be verified off; the line is closed all the same.
        """
        try:
            if self.link.is_open:
                self.switch(on=False)
                self.undervoltage_v = 0.0
                self.voltage_v = 0.0
        finally:
            self.link.close()

    def identify(self) -> Identity:
        """Get model, serial number and firmware."""
        model = self.query("IDN?")
        self._rating(model)
        return Identity(model=model.rpartition(",")[2], serial_number=self.query("SN?"), firmware=self.query("REV?"))

    def switch(self, *, on: bool) -> None:
        """Switch the output; read back.

        Raises
        ------
        DeviceFault
            E07 when a fault (interlock) forbids it, or when the read-back differs.
        """
        self.output = on
        if self.output is not on:
            what = f"output is {'off' if on else 'on'} after it was switched {'on' if on else 'off'}"
            raise DeviceFault(self.device, what, "open the interlock by hand")

    def protect(self, *, overvoltage_v: float, undervoltage_v: float, current_a: float) -> None:
        """Set the limits, with the set point as low as they allow, and read them back.

        The set point goes down first, because the supply refuses limits that contradict it.

        Raises
        ------
        LimitError
            When a value is out of range.
        DeviceFault
            When a value read back differs.
        """
        self.undervoltage_v = 0.0
        self.voltage_v = 0.0
        self.overvoltage_v = overvoltage_v
        self.current_a = current_a
        if undervoltage_v:
            self.voltage_v = undervoltage_v / 0.95
            self.undervoltage_v = undervoltage_v
        found = (self.overvoltage_v, self.undervoltage_v, self.current_a)
        wanted = (overvoltage_v, undervoltage_v, current_a)
        if any(abs(a - b) > 1e-3 * max(1.0, b) for a, b in zip(found, wanted, strict=True)):
            raise DeviceFault(self.device, f"OVP, UVL and PC read back as {found}, not {wanted}")

    def command(self, text: str) -> None:
        """Send a set command and make sure that the supply says ``OK``."""
        reply = self.query(text)
        if reply != "OK":
            self._in_step = False
            raise ProtocolError(self.device, f"answered {reply!r} to {text}, not OK")

    def query(self, text: str) -> str:
        """Send one message and get the text of its reply; two retries when none comes.

        Raises
        ------
        DeviceFault
            With the supply's error code and its meaning.
        Timeout, ProtocolError, LinkLost
            When no reply, or none in its form, came.
        """
        for left in reversed(range(TRIES)):
            try:
                self._synchronise()
                reply = self._exchange(text)
                break
            except (Timeout, ProtocolError):
                self._in_step = False
                if not left:
                    raise
        if reply in ERRORS:
            raise DeviceFault(self.device, f"refused {text}: {reply}, {ERRORS[reply]}", code=reply)
        return reply

    def get_number(self, key: str) -> float:
        """Ask for the number behind a mnemonic."""
        text = self.query(f"{key}?")
        try:
            return float(text)
        except ValueError as error:
            self._in_step = False
            raise ProtocolError(self.device, f"answered {text!r} to {key}?, which is no number") from error

    def set_number(self, key: str, value: float) -> None:
        """Set the number behind a mnemonic."""
        self.command(f"{key} {format_number(value)}")

    def _exchange(self, text: str) -> str:
        self.link.write(encode(text, with_checksum=self.checksum))
        return self._reply()

    def _reply(self) -> str:
        while True:
            line = self.link.read_until(END, timeout_s=ANSWER_S, limit=256)
            try:
                text = decode(line, with_checksum=self.checksum and not line.startswith(b"!"))
            except ValueError as error:
                raise ProtocolError(self.device, f"unreadable reply: {error}", "check the baud rate") from error
            if unsolicited_from(text) is None:
                return text
            self.unsolicited += 1

    def _synchronise(self) -> None:
        """After a failure, drop what comes late: nothing before the answer to ``IDN?`` counts."""
        if self._in_step:
            return
        self.link.drain(quiet_s=0.1)
        self._exchange(f"ADR {self.address}")
        reply = self._exchange("IDN?")
        while not reply.startswith(("LAMBDA", "TDK")):
            reply = self._reply()
        self.link.drain(quiet_s=0.1)
        self._in_step = True

    def _rating(self, model: str) -> tuple[float, float]:
        try:
            return parse_rating(model)
        except ValueError as error:
            what = f"another device answers: {model!r}"
            raise ProtocolError(self.device, what, "check which port is which in the settings") from error

    def _on_or_off(self, key: str) -> bool:
        text = self.query(f"{key}?")
        if text not in ("ON", "OFF"):
            self._in_step = False
            raise ProtocolError(self.device, f"answered {text!r} to {key}?, not ON or OFF")
        return text == "ON"

    def _register(self, query: str) -> int:
        text = self.query(query)
        try:
            if len(text) != 2:
                raise ValueError("not two digits")
            return int(text, 16)
        except ValueError as error:
            self._in_step = False
            raise ProtocolError(self.device, f"answered {text!r} to {query}, not two hex digits") from error
