"""SRS DG645 digital delay generator: PRF, trigger on and off, delays (protocol sheet ``dg645``).

Every setting is followed by ``LERR?``, so that a refusal is reported where it happens. The instrument has no watchdog:
the interlock chain and the gate of the sampling bridge protect against a host that is lost.
"""

from __future__ import annotations

from picoradar.drivers.dg645.output import OutputPort
from picoradar.drivers.dg645.session import TRIES, Dg645Session
from picoradar.drivers.dg645.wire import (
    Channel,
    Delay,
    Inhibit,
    InstrumentStatus,
    Output,
    TimeBase,
    TriggerSource,
    encode,
    format_number,
    parse_delay,
)
from picoradar.drivers.errors import DeviceFault, LimitError, ProtocolError, check_range
from picoradar.drivers.interfaces import Identity
from picoradar.drivers.links import Control, Reading
from picoradar.drivers.links.retry import retry

LONGEST_DELAY_S = 2000.0
OPENING_QUIET_S = 0.05  # silence after which the line counts as drained


class DG645(Dg645Session):
    """One delay generator on a serial line (9600 baud as shipped) or its raw TCP port.

    Parameters
    ----------
    link : SerialLink
        The line to it; owned by this object from now on.
    """

    trigger_source = Control("TSRC", TriggerSource, "Control what starts a cycle (`TriggerSource`).")
    trigger_rate_hz = Control(
        "TRAT",
        float,
        "Control the internal trigger rate in Hz (float from 0.0001 to 10e6).",
        limits=(1e-4, 10e6),
        unit="Hz",
    )
    trigger_level_v = Control(
        "TLVL",
        float,
        "Control the threshold of the external trigger in V (float from -3.5 to 3.5).",
        limits=(-3.5, 3.5),
        unit="V",
    )
    advanced_triggering = Control("ADVT", bool, "Control whether hold-off and prescaling act (bool).", limits=(0, 1))
    hold_off_s = Control(
        "HOLD",
        float,
        "Control the trigger hold-off in s (float from 0 to 2000).",
        limits=(0, LONGEST_DELAY_S),
        unit="s",
    )
    inhibit = Control("INHB", Inhibit, "Control what the INHIBIT input acts on (`Inhibit`).")
    burst = Control("BURM", bool, "Control whether one trigger starts a burst (bool).", limits=(0, 1))
    burst_count = Control(
        "BURC", int, "Control the cycles of a burst (int from 1 to 4294967295).", limits=(1, 2**32 - 1)
    )
    burst_period_s = Control(
        "BURP",
        float,
        "Control the period of a burst in s (float from 100e-9 to 42.9).",
        limits=(100e-9, 42.9),
        unit="s",
    )
    burst_delay_s = Control(
        "BURD",
        float,
        "Control the delay from trigger to burst in s (float from 0 to 2000).",
        limits=(0, LONGEST_DELAY_S),
        unit="s",
    )
    burst_t0_first_only = Control(
        "BURT", bool, "Control whether T0 comes in the first cycle of a burst only (bool).", limits=(0, 1)
    )
    instrument_enable = Control(
        "INSE", int, "Control which instrument status bits reach the status byte (int from 0 to 255).", limits=(0, 255)
    )
    event_enable = Control(
        "*ESE", int, "Control which standard event bits reach the status byte (int from 0 to 255).", limits=(0, 255)
    )
    service_enable = Control(
        "*SRE", int, "Control which status byte bits ask for service (int from 0 to 255).", limits=(0, 255)
    )
    time_base = Reading("TIMB", TimeBase, "Get the time base in use (`TimeBase`).")

    def open(self) -> None:
        """Open the line, make sure that a DG645 answers, empty its error queue and stop the triggers.

        Raises
        ------
        LinkLost, Timeout
            When the line or the device is not there.
        ProtocolError
            When another device answers, or the error queue does not end.
        DeviceFault
            When the triggers cannot be verified off.
        """
        self._open_line(encode(""), quiet_s=OPENING_QUIET_S)
        self.identify()
        self.link.write(encode("*CLS"))
        self.errors()
        self.found_on = () if self.trigger_source is TriggerSource.SINGLE_SHOT else ("triggers",)
        self.stop_triggers()

    def identify(self) -> Identity:
        """Get model, serial number and firmware.

        Raises
        ------
        ProtocolError
            When the answer is not a DG645's.
        """
        text = self.query("*IDN?")
        fields = text.split(",")
        if len(fields) != 4 or fields[1] != "DG645":
            what = f"another device answers: {text!r}"
            raise ProtocolError(self.device, what, "check which port is which in the settings")
        return Identity(model="DG645", serial_number=fields[2].removeprefix("s/n"), firmware=fields[3])

    def start_triggers(self) -> None:
        """Start the internal triggers (``TSRC 0``); read back."""
        self._switch(TriggerSource.INTERNAL)

    def stop_triggers(self) -> None:
        """Stop all triggers (``TSRC 5``: single shot, the safe state); read back."""
        self._switch(TriggerSource.SINGLE_SHOT)

    def trigger_once(self) -> None:
        """Start one cycle (``*TRG``)."""
        self.configure("*TRG")

    def set_delay(self, channel: Channel, reference: Channel, delay_s: float) -> None:
        """Control the delay of a channel after another in s (float from 0 to 2000, rounded to 5 ps).

        Raises
        ------
        LimitError
            Out of range, or T0 or T1 is to be set; nothing was sent.
        DeviceFault
            Code 13 when the channels would refer to each other in a loop.
        """
        check_range(self.device, f"delay of {channel.name}", delay_s, 0.0, LONGEST_DELAY_S, "s")
        self.configure(f"DLAY {_settable(self.device, channel)},{reference:d},{format_number(delay_s)}")

    def delay(self, channel: Channel) -> Delay:
        """Get reference and delay (s) of a channel.

        Raises
        ------
        ProtocolError
            When the reply is not a delay.
        """
        text = self.query(f"DLAY?{channel:d}")
        try:
            return parse_delay(text)
        except ValueError as error:
            raise ProtocolError(self.device, f"{text!r} is no delay") from error

    def link_channel(self, channel: Channel, reference: Channel) -> None:
        """Control which channel another one's delay counts from.

        Whether the instant or the delay stays is not verified: read `delay` back, or use `set_delay`, which sets both.
        """
        self.configure(f"LINK {_settable(self.device, channel)},{reference:d}")

    def linked_to(self, channel: Channel) -> Channel:
        """Get the channel that the delay of ``channel`` counts from."""
        return Channel(self.integer(f"LINK?{channel:d}", minimum=0, maximum=9))

    def set_step(self, channel: Channel, step_s: float) -> None:
        """Control the step size of a channel in s (float from 0 to 2000)."""
        check_range(self.device, f"step of {channel.name}", step_s, 0.0, LONGEST_DELAY_S, "s")
        self.configure(f"SSDL {_settable(self.device, channel)},{format_number(step_s)}")

    def step_size_s(self, channel: Channel) -> float:
        """Get the step size of a channel (s)."""
        return self.number(f"SSDL?{channel:d}")

    def step(self, channel: Channel, *, up: bool) -> None:
        """Change the delay of a channel by its step size."""
        self.configure(f"SPDL {_settable(self.device, channel)},{up:d}")

    def output(self, output: Output) -> OutputPort:
        """Get one output, to control its level, polarity and prescaling."""
        return OutputPort(self, output)

    def instrument_status(self) -> InstrumentStatus:
        """Get the instrument status register; reading clears it."""
        return InstrumentStatus(self.integer("INSR?", minimum=0, maximum=255))

    def self_test(self) -> int:
        """Get the result of the self test: 0 or an error code."""
        return self.integer("*TST?", minimum=0, maximum=254)

    def calibrate(self) -> int:
        """Get the result of a self calibration: 0 or an error code."""
        return self.integer("*CAL?", minimum=0, maximum=254)

    def show(self, item: int, channel: Channel) -> None:
        """Choose what the front panel displays (``DISP``)."""
        self.configure(f"DISP {item:d},{channel:d}")

    def release(self) -> None:
        """Give the front panel back to a person (``LCAL``)."""
        self.configure("LCAL")

    def save(self, memory: int) -> None:
        """Save all settings (memory 1 to 9)."""
        check_range(self.device, "memory", memory, 1, 9)
        self.configure(f"*SAV {memory:d}")

    def recall(self, memory: int) -> None:
        """Recall all settings (memory 1 to 9; 0 = defaults)."""
        check_range(self.device, "memory", memory, 0, 9)
        self.configure(f"*RCL {memory:d}")

    def reset(self) -> None:
        """Restore the defaults (``*RST``) and stop the triggers."""
        self.configure("*RST", "TSRC 5")

    def _make_safe(self) -> None:
        self.stop_triggers()

    def _switch(self, source: TriggerSource) -> None:
        """Set the source and read it back; both again if a reply is lost, which does no harm."""
        found = retry(TRIES, lambda: self._set_source(source))
        if found is not source:
            what = f"trigger source is {found.name} after it was set to {source.name}"
            raise DeviceFault(self.device, what, "open the interlock by hand")

    def _set_source(self, source: TriggerSource) -> TriggerSource:
        self.trigger_source = source
        return self.trigger_source


def _settable(device: str, channel: Channel) -> int:
    if channel in (Channel.T0, Channel.T1):
        raise LimitError(device, f"channel {channel.name} has no delay of its own; use A to H; nothing was sent")
    return int(channel)
