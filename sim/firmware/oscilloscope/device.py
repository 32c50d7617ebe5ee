"""The simulated sampling oscilloscope: SCPI commands of the 86100 family, in the role of an HP 54120B.

Source: protocol sheet ``dca_scpi_waveform.md``. It is triggered at 20 kHz at the most and uses every n-th
pulse of a faster trigger.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from picoradar.drivers.clock import Clock, Timer
from picoradar.sim.firmware.oscilloscope.scpi import Handler, ScpiError, ScpiParser, choice, number, only
from picoradar.sim.firmware.oscilloscope.usbtmc import UsbtmcFirmware, tmc_descriptors
from picoradar.sim.firmware.oscilloscope.waveform import TakenWaveform, real
from picoradar.sim.wires import Acquisition, SignalSource, TriggerLine

VENDOR_ID = 0x1209
PRODUCT_ID = 0x0002
MODEL = "SLR sampling oscilloscope"
RATE_MAX_HZ = 20_000.0
TRIGGER_POLL_S = 1e-3
POINTS_MAX = 262_144
COUNT_MAX = 4096
ZERO_CODE, MV_PER_CODE = 32.0, 0.5  # of the signal sources
_ON_OFF = {"ON": "1", "OFF": "0", "1": "1", "0": "0"}
_FORMATS = {"ASCII": "ASC", "BYTE": "BYTE", "WORD": "WORD", "LONG": "LONG"}


class OscilloscopeFirmware(UsbtmcFirmware):
    """A sampling oscilloscope with a USB488 interface.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    trigger : TriggerLine
        Its trigger input.
    source : SignalSource
        Signal at its channel 1, in codes of `MV_PER_CODE` with `ZERO_CODE` at 0 V.
    detector : SignalSource, optional
        Signal at its channel 2, in the same codes; without one it has no channel 2.
    current : SignalSource, optional
        Likewise at its channel 3.
    gate_open : callable
        Whether triggers reach the laser.
    serial_number : str
    """

    def __init__(
        self,
        clock: Clock,
        trigger: TriggerLine,
        source: SignalSource,
        *,
        detector: SignalSource | None = None,
        current: SignalSource | None = None,
        gate_open: Callable[[], bool] = lambda: True,
        serial_number: str = "SO-0001",
    ) -> None:
        wired = {"CHAN1": source, "CHAN2": detector, "CHAN3": current}
        sources = {channel: signal for channel, signal in wired.items() if signal is not None}
        instrument = Scope(clock, trigger, sources, gate_open, serial_number)
        super().__init__(instrument, tmc_descriptors(VENDOR_ID, PRODUCT_ID, ("picoradar", MODEL, serial_number)))


class Scope(ScpiParser):
    """The instrument behind the interface.

    One waveform is digitised at a time; meanwhile no further command is begun, as with a sequential command.
    """

    def __init__(
        self,
        clock: Clock,
        trigger: TriggerLine,
        sources: Mapping[str, SignalSource],
        gate_open: Callable[[], bool],
        serial_number: str,
    ) -> None:
        self._sources = dict(sources)
        super().__init__(self._commands())
        self._clock = clock
        self._trigger = trigger
        self._gate_open = gate_open
        self._serial_number = serial_number
        self._taken = 0
        self._timer: Timer | None = None
        self._waveform: TakenWaveform | None = None
        self._settings: dict[str, float] = {}
        self._words: dict[str, str] = {}
        self._reset()

    def trigger(self) -> None:
        """Take one waveform, as ``*TRG`` does."""
        self.execute(b":DIGitize CHANnel1")

    def clear(self) -> None:
        """Carry out a device clear: abort the acquisition, forget messages and answers."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        super().clear()

    def _commands(self) -> dict[str, Handler]:
        commands: dict[str, Handler] = {
            "*IDN?": lambda _: f"picoradar,{MODEL},{self._serial_number},1.0",
            "*RST": lambda _: self._reset(),
            "*CLS": lambda _: self.clear_status(),
            "*OPC?": lambda _: "1",
            "*OPC": lambda _: self.complete(),
            "*ESR?": lambda _: str(self.pop_events()),
            "*STB?": lambda _: str(self.status_byte),
            "*ESE": lambda a: setattr(self, "event_enable", int(number(a, 0, 255))),
            "*ESE?": lambda _: str(self.event_enable),
            "*SRE": lambda a: setattr(self, "service_enable", int(number(a, 0, 255)) & ~0x40),
            "*SRE?": lambda _: str(self.service_enable),
            "*TRG": lambda _: self._digitize(),
            ":SYSTem:HEADer": lambda a: setattr(self, "headers", choice(a, _ON_OFF) == "1"),
            ":SYSTem:HEADer?": lambda _: str(int(self.headers)),
            ":SYSTem:ERRor?": lambda _: self.pop_error(),
            ":TIMebase:SCALe": lambda a: self._set("range_s", 10 * number(a, 1e-14, 0.1)),
            ":TIMebase:SCALe?": lambda _: real(self._settings["range_s"] / 10),
            ":DIGitize": self._digitize_channel,
            ":WAVeform:POINts?": lambda _: str(len(self._having_data().codes)),
            ":WAVeform:PREamble?": lambda _: self._preamble(),
            ":WAVeform:DATA?": lambda _: self._having_data().data(self._words["format"], self._words["byteorder"]),
        }
        for source in self._sources:
            channel = f":CHANnel{source[-1]}"
            commands |= self._number_setting(f"{channel}:RANGe", f"{source}_scale_v", (1e-3, 8.0), per_unit=8)
            commands |= self._number_setting(f"{channel}:SCALe", f"{source}_scale_v", (1e-4, 1.0))
            commands |= self._number_setting(f"{channel}:OFFSet", f"{source}_offset_v", (-2.0, 2.0))
        for header, name, limits in (
            (":TIMebase:RANGe", "range_s", (1e-13, 1.0)),
            (":TIMebase:POSition", "position_s", (0.0, 1.0)),
            (":ACQuire:POINts", "points", (1, POINTS_MAX)),
            (":ACQuire:COUNt", "count", (1, COUNT_MAX)),
        ):
            commands |= self._number_setting(header, name, limits)
        for header, name, forms in (
            (":TRIGger:SOURce", "trigger", {"EXTERNAL": "EXT"}),
            (":ACQuire:AVERage", "average", _ON_OFF),
            (":WAVeform:SOURce", "source", {f"CHANNEL{source[-1]}": source for source in self._sources}),
            (":WAVeform:FORMat", "format", _FORMATS),
            (":WAVeform:BYTeorder", "byteorder", {"LSBFIRST": "LSBF", "MSBFIRST": "MSBF"}),
        ):
            commands |= self._word_setting(header, name, forms)
        for place, field in enumerate(("XINCrement", "XORigin", "XREFerence", "YINCrement", "YORigin", "YREFerence")):
            commands[f":WAVeform:{field}?"] = self._preamble_query(4 + place)
        return commands

    def _number_setting(
        self, header: str, name: str, limits: tuple[float, float], *, per_unit: float = 1.0
    ) -> dict[str, Handler]:
        """Make command and query of a number, of which the setting ``name`` is the ``per_unit``-th part."""
        return {
            header: lambda arguments: self._set(name, number(arguments, *limits) / per_unit),
            f"{header}?": lambda _: real(self._settings[name] * per_unit),
        }

    def _word_setting(self, header: str, name: str, forms: Mapping[str, str]) -> dict[str, Handler]:
        """Make command and query of a word."""
        return {
            header: lambda arguments: self._words.update({name: choice(arguments, forms)}),
            f"{header}?": lambda _: self._words[name],
        }

    def _preamble_query(self, place: int) -> Handler:
        return lambda _: self._preamble().split(",")[place]

    def _reset(self) -> None:
        self._settings = {
            "range_s": 1e-8,
            "position_s": 2e-8,
            "points": 451,
            "count": 16,
            **{f"{source}_scale_v": 0.05 for source in self._sources},
            **{f"{source}_offset_v": 0.0 for source in self._sources},
        }
        self._words = {"trigger": "EXT", "average": "0", "source": "CHAN1", "format": "BYTE", "byteorder": "MSBF"}
        self._waveform = None
        self.headers = True

    def _set(self, name: str, value: float) -> None:
        self._settings[name] = float(round(value)) if name in ("points", "count") else value

    def _digitize_channel(self, arguments: list[str]) -> None:
        wanted = only(arguments).upper().replace("CHANNEL", "CHAN")
        if wanted not in self._sources:
            raise ScpiError(-224, f"Illegal parameter value; {arguments[0]}")
        self._digitize(wanted)

    def _digitize(self, source: str = "CHAN1") -> None:
        """Take a waveform of one channel; the commands that follow wait for it."""
        self.busy = True
        self._waveform = None
        if self._trigger.rate_hz <= 0:
            self._timer = self._clock.call_at(self._clock.now() + TRIGGER_POLL_S, lambda: self._digitize(source))
            return
        rate_hz = self._trigger.rate_hz / math.ceil(self._trigger.rate_hz / RATE_MAX_HZ)
        sweeps = int(self._settings["count"]) if self._words["average"] == "1" else 1
        begin = self._clock.now()
        shots = sweeps * int(self._settings["points"])
        self._timer = self._clock.call_at(
            begin + shots / rate_hz, lambda: self._digitized(source, begin, rate_hz, sweeps)
        )

    def _digitized(self, source: str, begin: float, rate_hz: float, sweeps: int) -> None:
        points = int(self._settings["points"])
        increment_s = self._settings["range_s"] / points
        sums = self._sources[source].acquire(
            Acquisition(
                key=(0, self._taken, 0, 0),  # run 0: the bridge never uses that number
                start_s=begin,
                prf_hz=rate_hz,
                delay_ps=self._settings["position_s"] * 1e12,
                step_ps=increment_s * 1e12,
                samples=points,
                sweeps=sweeps,
                settle_shots=0,
                gate_open=self._gate_open(),
            )
        )
        self._taken += 1
        volts = (sums / sweeps - ZERO_CODE) * MV_PER_CODE * 1e-3
        self._waveform = TakenWaveform.of_volts(
            volts,
            (sums >= 255 * sweeps, sums == 0),
            sweeps,
            (increment_s, self._settings["position_s"]),
            (4 * self._settings[f"{source}_scale_v"], self._settings[f"{source}_offset_v"]),
            MODEL,
        )
        self.busy = False
        self._timer = None
        self.run()

    def _having_data(self) -> TakenWaveform:
        if self._waveform is None:
            raise ScpiError(-230, "Data corrupt or stale; no waveform has been taken")
        return self._waveform

    def _preamble(self) -> str:
        return self._having_data().preamble(self._words["format"])
