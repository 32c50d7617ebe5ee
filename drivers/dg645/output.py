"""One front panel output of a DG645: level, polarity, prescaling (protocol sheet ``dg645``)."""

from __future__ import annotations

from picoradar.drivers.dg645.session import Dg645Session
from picoradar.drivers.dg645.wire import Output, format_number
from picoradar.drivers.links import Control


class OutputPort:
    """An output; the same mnemonics for each, with its number as first parameter.

    Parameters
    ----------
    session : Dg645Session
        The instrument.
    output : Output
        Which one.
    """

    def __init__(self, session: Dg645Session, output: Output) -> None:
        self.session = session
        self.output = output

    @property
    def device(self) -> str:
        """Get the device's name for messages, with the output's."""
        return f"{self.session.device}, output {self.output.name}"

    amplitude_v = Control(
        "LAMP", float, "Control the amplitude into 50 ohm in V (float from 0.5 to 5).", limits=(0.5, 5.0), unit="V"
    )
    offset_v = Control("LOFF", float, "Control the offset in V (float from -2 to 2).", limits=(-2.0, 2.0), unit="V")
    positive = Control("LPOL", bool, "Control whether pulses are positive (bool).", limits=(0, 1))
    prescale = Control(
        "PRES",
        int,
        "Control how many triggers make one pulse (of T0: one cycle) (int from 1 to 65535).",
        limits=(1, 65535),
    )
    phase = Control(
        "PHAS",
        int,
        "Control at which of these triggers the pulse comes (int from 0 to 65534; T0 has none).",
        limits=(0, 65534),
    )

    def get_number(self, key: str) -> float:
        """Query the number of a mnemonic."""
        return self.session.number(f"{key}?{self.output:d}")

    def set_number(self, key: str, value: float) -> None:
        """Set the number of a mnemonic; checked by ``LERR?``."""
        self.session.configure(f"{key} {self.output:d},{format_number(value)}")
