"""Sampling oscilloscope of the 86100 family: a second source of waveforms, over USBTMC and SCPI.

It has the role of the dissertation's HP 54120B: triggered at 20 kHz at the most, usually 16 averages. It has no gate in
the trigger line; the sampling bridge has. Source: protocol sheets ``dca_scpi_waveform.md``, ``usbtmc.md``.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from picoradar.drivers.clock import Clock
from picoradar.drivers.errors import DeviceError, DeviceFault, LimitError, ProtocolError, Timeout, check_range
from picoradar.drivers.interfaces import Identity, Record, Sampler, SamplerStatus, SweepSettings
from picoradar.drivers.links import INTERFACE_CLASS, UsbIdentity, UsbLink, Usbtmc
from picoradar.drivers.oscilloscope.record import waveform_record
from picoradar.drivers.oscilloscope.scpi import ScpiSession
from picoradar.drivers.oscilloscope.waveform import BadWaveform, Preamble, decode_block, decode_words

VENDOR_ID = 0x1209  # placeholder of the simulated instrument; name your own in the settings
PRODUCT_ID = 0x0002
RATE_MAX_HZ = 20_000.0
POINTS_MAX = 262_144
AVERAGES_MAX = 4096
STEP_MIN_PS = 0.1
STEP_MAX_PS = 1e6
QUIET_S = 0.5
CODES = 50_000  # codes of a record over the vertical range: finer than the instrument's own, so nothing is lost
CODES_BELOW = 5_000  # room below the range, so that noise there stays positive


def oscilloscope_link(
    clock: Clock,
    *,
    vendor_id: int = VENDOR_ID,
    product_id: int = PRODUCT_ID,
    serial_number: str | None = None,
    backend: object | None = None,
) -> UsbLink:
    """Make the link to an oscilloscope with a USB488 interface."""
    identity = UsbIdentity(vendor_id, product_id, serial_number, INTERFACE_CLASS)
    return UsbLink(identity, clock, device="oscilloscope", backend=backend)


class Oscilloscope:
    """Sampler that averages in the instrument.

    Parameters
    ----------
    tmc : Usbtmc
        Messages to the instrument.
    gate : Sampler, optional
        The device that has the gate in the trigger line, normally the sampling bridge; without one there is no light.
    channel : int
        Input channel of the signal.
    full_scale_v, offset_v : float
        Vertical range (8 divisions) and voltage at its centre.
    """

    def __init__(
        self,
        tmc: Usbtmc,
        *,
        gate: Sampler | None = None,
        channel: int = 1,
        full_scale_v: float = 0.16,
        offset_v: float = 0.048,
    ) -> None:
        self.tmc = tmc
        self.gate = gate
        self._scpi = ScpiSession(tmc)
        self._channel = f"CHANnel{channel}"
        self.full_scale_v = full_scale_v
        self.offset_v = offset_v
        self._device = tmc.link.device
        self._identity = Identity("oscilloscope")
        self._sweep: SweepSettings | None = None

    @property
    def found_on(self) -> tuple[str, ...]:
        """Get whether the gate was on at opening."""
        return self.gate.found_on if self.gate else ()

    @property
    def zero_code(self) -> float:
        """Get the code of 0 V in the records: a fixed scale over the vertical range."""
        return CODES_BELOW + (self.full_scale_v / 2 - self.offset_v) * 1e3 / self.mv_per_code

    @property
    def mv_per_code(self) -> float:
        """Get the size of a code in the records, mV."""
        return self.full_scale_v * 1e3 / CODES

    def open(self) -> None:
        """Open gate and instrument, switch off the headers in its answers, and identify it."""
        if self.gate is not None:
            self.gate.open()
        self.tmc.open()
        try:
            self._scpi.write("*CLS")
            self._scpi.write(":SYSTem:HEADer OFF")
            fields = [*self._scpi.query("*IDN?").split(","), "", "", ""]
            self._identity = Identity(" ".join(fields[:2]), fields[2], fields[3])
            self._scpi.write(f":WAVeform:SOURce {self._channel};FORMat WORD;BYTeorder LSBFirst")
            self._scpi.check_errors()
        except DeviceError:
            self.tmc.close()
            raise
        self._sweep = None

    def close(self) -> None:
        """Release the instrument, and close the device that has the gate."""
        self.tmc.close()
        if self.gate is not None:
            self.gate.close()

    def identify(self) -> Identity:
        """Get manufacturer and model, serial number and firmware, as read at opening."""
        return self._identity

    def configure(self, sweep: SweepSettings) -> None:
        """Set time base, averages and vertical scale; each read back.

        Raises
        ------
        LimitError
            When a value is out of range; nothing was sent. Settle shots must be 0: the instrument cannot discard any.
        DeviceFault
            When the instrument refuses or rounds a value.
        """
        check_range(self._device, "samples", sweep.samples, 1, POINTS_MAX)
        check_range(self._device, "averages", sweep.averages, 1, AVERAGES_MAX)
        check_range(self._device, "step", sweep.step_ps, STEP_MIN_PS, STEP_MAX_PS, "ps")
        check_range(self._device, "start delay", sweep.start_ps, 0.0, 1e9, "ps")
        if not 0 < sweep.prf_hz < math.inf:
            raise LimitError(self._device, f"PRF {sweep.prf_hz} Hz is not positive; nothing was sent")
        if sweep.settle_shots:
            raise LimitError(
                self._device, f"settle shots {sweep.settle_shots}: it cannot discard any, set 0; nothing was sent"
            )
        self._sweep = None
        for header, value in (
            (":TIMebase:RANGe", sweep.samples * sweep.step_ps * 1e-12),
            (":TIMebase:POSition", sweep.start_ps * 1e-12),
            (f":{self._channel}:SCALe", self.full_scale_v / 8),
            (f":{self._channel}:OFFSet", self.offset_v),
            (":ACQuire:POINts", sweep.samples),
            (":ACQuire:COUNt", sweep.averages),
        ):
            self._scpi.set(header, value)
        self._scpi.write(":TRIGger:SOURce EXTernal;:ACQuire:AVERage ON")
        self._scpi.check_errors()
        if self.gate is not None:
            self.gate.configure(sweep)
        self._sweep = sweep

    def take(self, run_id: int, records: int = 1) -> list[Record]:
        """Take that many averaged waveforms.

        Returns
        -------
        list of Record
            Sums are the instrument's codes, shifted to be positive; a clipped sample is at the end of the scale.

        Raises
        ------
        DeviceFault
            When it is not configured, or has used another time axis.
        Timeout
            When a waveform is not finished in time; the acquisition was aborted.
        ProtocolError
            When an answer is malformed, or samples are missing (gaps are never filled).
        """
        sweep = self._sweep
        if sweep is None:
            raise DeviceFault(self._device, "is not configured", "call configure first")
        return [self._record(sweep, run_id, number) for number in range(records)]

    def gate_on(self) -> None:
        """Let triggers through to the laser, by the device that has the gate; `DeviceFault` when there is none."""
        if self.gate is None:
            raise DeviceFault(self._device, "has no gate in the trigger line", "name the sampling bridge as its gate")
        self.gate.gate_on()

    def gate_off(self) -> None:
        """Block the triggers to the laser; without a gate they were never let through from here."""
        if self.gate is not None:
            self.gate.gate_off()

    def heartbeat(self) -> None:
        """Feed the watchdog of the gate."""
        if self.gate is not None:
            self.gate.heartbeat()

    def clear_lockout(self) -> None:
        """End a lock-out of the gate."""
        if self.gate is not None:
            self.gate.clear_lockout()

    def stop(self) -> None:
        """Abort the acquisition and empty all buffers (device clear)."""
        self.tmc.clear()

    def status(self) -> SamplerStatus:
        """Measure the present state: that of the gate, with the instrument's error queue."""
        problems = self._scpi.errors()
        if self.gate is None:
            return SamplerStatus("idle", "off", False, False, 0.0, 0.0, "; ".join([*problems, "no trigger gate"]))
        gate = self.gate.status()
        problem = "; ".join([p for p in (gate.problem, *problems) if p])
        return replace(gate, problem=problem, clock_locked=True)  # the bridge's clock does not time these records

    def _record(self, sweep: SweepSettings, run_id: int, number: int) -> Record:
        record_s = sweep.averages * sweep.samples / min(sweep.prf_hz, RATE_MAX_HZ)
        begin = self.tmc.link.clock.now()
        self._scpi.write(f":DIGitize {self._channel};*OPC?")
        try:
            self.tmc.read(timeout_s=3 * record_s + QUIET_S)
        except Timeout as late:
            self.stop()
            remedy = "check that the triggers run and reach its trigger input"
            raise Timeout(self._device, f"no waveform within {3 * record_s + QUIET_S:.1f} s", remedy) from late
        try:
            preamble = Preamble.decode(self._scpi.query(":WAVeform:PREamble?"))
            codes = decode_words(decode_block(self.tmc.query(b":WAVeform:DATA?\n")), preamble)
            self._check_axis(preamble, sweep)
            taken = waveform_record(preamble, codes, run_id=run_id, number=number, time_us=round(begin * 1e6))
        except BadWaveform as error:
            raise ProtocolError(self._device, str(error)) from error
        sums = np.rint(taken.trace_mv / self.mv_per_code + self.zero_code).astype(np.uint32)
        return replace(taken, sums=sums, zero_code=self.zero_code, mv_per_code=self.mv_per_code)

    def _check_axis(self, preamble: Preamble, sweep: SweepSettings) -> None:
        first_ps = (preamble.x_origin - preamble.x_reference * preamble.x_increment) * 1e12
        off_ps = max(
            abs(first_ps - sweep.start_ps),
            abs(preamble.x_increment * 1e12 - sweep.step_ps) * sweep.samples,
        )
        if preamble.points != sweep.samples or off_ps > 0.01:
            raise DeviceFault(
                self._device,
                f"took {preamble.points} points of {preamble.x_increment * 1e12:.4f} ps from {first_ps:.3f} ps, "
                f"not {sweep.samples} of {sweep.step_ps:.4f} ps from {sweep.start_ps:.3f} ps",
            )
