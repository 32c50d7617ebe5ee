"""TDK-Lambda Genesys programmable DC supply: drive voltage of the laser pulser (protocol sheet ``tdk_genesys``).

The supply has no watchdog: the interlock at its ENA terminals protects against a host that is lost.
"""

from __future__ import annotations

from picoradar.drivers.errors import DeviceFault, ProtocolError
from picoradar.drivers.genesys.session import GenesysSession
from picoradar.drivers.genesys.wire import END, Fault, Filter, Remote, Status, SupplyState, parse_rating, parse_state
from picoradar.drivers.interfaces import Identity
from picoradar.drivers.links import Control, Reading, SerialLink


class Genesys(GenesysSession):
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
    """

    def __init__(self, link: SerialLink, address: int = 6, *, checksum: bool = False) -> None:
        super().__init__(link, address, checksum=checksum)
        self.rated_v = 600.0
        self.rated_a = 1.3

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
        "Control the minimum voltage set point in V (float from 0 to 0.95 x rating).",
        limits=lambda supply: (0.0, 0.95 * supply.rated_v),
        unit="V",
    )
    foldback_delay: Control[str, int] = Control(
        "FBD", int, "Control the foldback delay in 0.1 s, added to 0.25 s (int from 0 to 255).", limits=(0, 255)
    )
    filter_hz = Control("FILTER", Filter, "Control the measuring filter (`Filter`).")
    measured_v = Reading("MV", float, "Measure the output voltage in V.")
    measured_a = Reading("MC", float, "Measure the output current in A.")

    output = Control("OUT", bool, "Control whether the output is on (bool).", limits=(0, 1))
    auto_start = Control(
        "AST",
        bool,
        "Control whether the output comes back by itself after a mains failure (bool; False on this bench).",
        limits=(0, 1),
    )
    foldback = Control("FLD", bool, "Control whether constant current shuts the output down (bool).", limits=(0, 1))

    @property
    def remote(self) -> Remote:
        """Control who may operate it (`Remote`)."""
        text = self.query("RMT?")
        if text not in Remote.__members__:
            raise ProtocolError(self.device, f"answered {text!r} to RMT?")
        return Remote[text]

    @remote.setter
    def remote(self, who: Remote) -> None:
        self.command(f"RMT {who:d}")

    @property
    def mode(self) -> str:
        """Get what the output does: ``CV``, ``CC`` or ``OFF``."""
        return self.query("MODE?")

    @property
    def fault(self) -> Fault:
        """Get the fault register as it is now."""
        return Fault(self.get_register("FLT"))

    @property
    def status(self) -> Status:
        """Get the status register as it is now."""
        return Status(self.get_register("STAT"))

    def fault_events(self) -> Fault:
        """Get the enabled faults since the last call; reading clears them."""
        return Fault(self.get_register("FEVE"))

    def status_events(self) -> Status:
        """Get the enabled status changes since the last call; reading clears them."""
        return Status(self.get_register("SEVE"))

    def enable_events(self, faults: Fault, status: Status) -> None:
        """Control which faults are kept as events, and which status bits (`Status.FAULT`) send a message unasked."""
        self.command(f"FENA {faults:02X}")
        self.command(f"SENA {status:02X}")

    def state(self) -> SupplyState:
        """Measure set points, output and both registers in one exchange (``STT?``).

        Raises
        ------
        ProtocolError
            When the reply has not the expected form.
        """
        text = self.query("STT?")
        try:
            return parse_state(text)
        except ValueError as error:
            raise ProtocolError(self.device, str(error)) from error

    def open(self) -> None:
        """Open the line, select the unit, take remote control, and switch output and auto-start off.

        Raises
        ------
        LinkLost, Timeout
            When the line or the device is not there.
        ProtocolError
            When another device answers.
        DeviceFault
            When the output cannot be verified off.
        """
        self.unsolicited = 0
        self._open_line(END)
        self.command(f"ADR {self.address}")
        model = self.query("IDN?")
        if model == "OK":  # to the end of line above, so late that every answer belongs to the question before
            self._synchronised = False
            model = self.query("IDN?")
        self.rated_v, self.rated_a = self._rating(model)
        self.remote = Remote.REM
        self.found_on = ("supply",) if self.output else ()
        self.auto_start = False
        self.switch(on=False)
        if self.auto_start:
            what = "auto-start is on after it was set off: the output would come back by itself"
            raise DeviceFault(self.device, what, "set it off at the front panel, or have it serviced")

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

        The set point is lowered first, because the supply refuses limits that contradict it.

        Parameters
        ----------
        overvoltage_v, undervoltage_v : float
            Over-voltage trip, and under-voltage limit of the set point.
        current_a : float
            Current limit.

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

    def highest_overvoltage(self) -> None:
        """Set the over-voltage trip as high as the model allows (``OVM``)."""
        self.command("OVM")

    def reset_foldback_delay(self) -> None:
        """Set the foldback delay to its shortest (``FBDRST``)."""
        self.command("FBDRST")

    def clear_events(self) -> None:
        """Clear both event registers (``CLS``)."""
        self.command("CLS")

    def save(self) -> None:
        """Save the settings in the supply (``SAV``)."""
        self.command("SAV")

    def recall(self) -> None:
        """Recall the saved settings (``RCL``)."""
        self.command("RCL")

    def reset(self) -> None:
        """Go to 0 V, 0 A, output and auto-start off, highest over-voltage trip, foldback off (``RST``)."""
        self.command("RST")

    def _make_safe(self) -> None:
        self.switch(on=False)
        self.undervoltage_v = 0.0
        self.voltage_v = 0.0

    def _rating(self, model: str) -> tuple[float, float]:
        try:
            return parse_rating(model)
        except ValueError as error:
            what = f"another device answers: {model!r}"
            raise ProtocolError(self.device, what, "check which port is which in the settings") from error
