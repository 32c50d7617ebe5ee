# ruff: noqa: ARG002 (the arguments are those of the UsbFirmware protocol)
"""Firmware of the simulated sampling bridge, SBP 1.0 or 1.1: control requests and status.

Source: protocol sheet ``sampling_bridge.md``. The gate is in `picoradar.sim.firmware.bridge.gate`, the acquisition in
`picoradar.sim.firmware.bridge.run`, the checks of configurations in `picoradar.sim.firmware.bridge.checks`.
"""

from __future__ import annotations

from picoradar.drivers.bridge import sbp
from picoradar.drivers.bridge.sbp import ErrorCode, EventKind, Request, State, StatusFlag
from picoradar.drivers.clock import Clock
from picoradar.sim.firmware.bridge.checks import Refused, check_configuration, check_windows, expect_empty, flag, u32
from picoradar.sim.firmware.bridge.gate import TriggerGate
from picoradar.sim.firmware.bridge.identity import blocks, descriptors
from picoradar.sim.firmware.bridge.reports import Reports
from picoradar.sim.firmware.bridge.run import Acquirer
from picoradar.sim.usb import Setup, UsbStall
from picoradar.sim.wires import InterlockChain, SignalSource, TriggerLine

_TO_HOST = 0xC1
_TO_DEVICE = 0x41


class SamplingBridgeFirmware:
    """A sampling bridge.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    trigger : TriggerLine
        Laser triggers before the gate.
    interlock : InterlockChain
        Its opening closes the gate.
    source : SignalSource
        Photodiode, bridge and A/D.
    version : int
        Protocol version: 0x0100, or 0x0101 with windows and advance input.
    serial_number : str
        Up to 16 ASCII characters.

    Attributes
    ----------
    gate : TriggerGate
    acquirer : Acquirer
    reports : Reports
    """

    def __init__(
        self,
        clock: Clock,
        trigger: TriggerLine,
        interlock: InterlockChain,
        source: SignalSource,
        *,
        version: int = sbp.VERSION_1_1,
        serial_number: str = "SB-0001",
    ) -> None:
        self.clock = clock
        self.descriptors = descriptors(serial_number)
        self.info, self.caps = blocks(version, serial_number)
        self.interlock = interlock
        self.reports = Reports(clock)
        self.clock_locked = True
        self._configuration = b""
        self.gate = TriggerGate(clock, interlock, self.caps, self._gate_changed, self._watchdog_tripped)
        self.acquirer = Acquirer(clock, trigger, source, self.gate, self.caps, self.reports)
        interlock.on_change(self._interlock_changed)

    @property
    def gate_open(self) -> bool:
        """Get whether triggers reach the laser now; a configuration may keep them off between records."""
        configuration = self.acquirer.configuration
        recording = self.acquirer.state in (State.RUNNING, State.STOPPING)
        pauses = configuration is not None and bool(configuration.flags & sbp.ConfigFlag.GATE_BETWEEN)
        return self.gate.state is sbp.Gate.ON and (recording or not pauses)

    def advance(self) -> None:
        """Take a rising edge of the advance input (version 1.1)."""
        self.acquirer.advance()

    # The bus

    def control(self, setup: Setup, data: bytes) -> bytes:
        """Carry out a control request; a refused one stalls, and the reason is queued."""
        try:
            if setup.request_type == _TO_HOST and setup.index & 0xFF == 0:
                return self._get(setup)
            if setup.request_type == _TO_DEVICE and setup.index & 0xFF == 0:
                self._set(setup, data)
                return b""
            raise Refused(ErrorCode.UNKNOWN_REQUEST, setup.request)
        except Refused as refused:
            self.reports.error(refused.code, refused.detail, request=setup.request)
            raise UsbStall(str(refused)) from refused

    def receive(self, endpoint: int, data: bytes) -> bool:
        """Refuse: the device has no OUT endpoint."""
        raise UsbStall(f"endpoint {endpoint:#04x} takes no data")

    def take(self, endpoint: int) -> bytes | None:
        """Give the next frame or event."""
        if endpoint == sbp.EP_DATA:
            return self.acquirer.take()
        return self.reports.pop_event()

    def configured(self, value: int) -> None:
        """Close the gate and end the run when the device is unconfigured."""
        if value == 0:
            self.bus_reset()

    def alternate_selected(self, interface: int, alternate: int) -> None:
        """There is one alternate setting only."""

    def halt_cleared(self, endpoint: int) -> None:
        """The host flushes and starts again by itself (framing rule 7)."""

    def bus_reset(self) -> None:
        """Close the gate and return to the state after power-up."""
        self._reset()

    # Requests

    def _get(self, setup: Setup) -> bytes:
        match setup.request:
            case Request.GET_INFO:
                answer = self.info.encode()
            case Request.GET_CAPS:
                answer = self.caps.encode()
            case Request.GET_STATUS:
                answer = self.status().encode()
            case Request.GET_CONFIG:
                if not self._configuration:
                    raise Refused(ErrorCode.NOT_CONFIGURED)
                answer = self._configuration
            case Request.GET_ERROR:
                return self.reports.pop_error().encode()
            case _:
                raise Refused(ErrorCode.UNKNOWN_REQUEST, setup.request)
        if setup.value:
            raise Refused(ErrorCode.BAD_VALUE, setup.value)
        return answer

    def _set(self, setup: Setup, data: bytes) -> None:
        match setup.request:
            case Request.SET_CONFIG:
                self._set_config(data, check_only=flag(setup.value))
            case Request.SET_WINDOWS if self.caps.version >= sbp.VERSION_1_1:
                self._set_windows(data, check_only=flag(setup.value))
            case Request.START:
                self._start(u32(data))
            case Request.STOP:
                expect_empty(data)
                self.acquirer.stop(at_once=flag(setup.value))
            case Request.FLUSH:
                expect_empty(data)
                if self.acquirer.state in (State.RUNNING, State.STOPPING):
                    raise Refused(ErrorCode.BUSY, self.acquirer.state)
                self.acquirer.queue.flush()
            case Request.LASER:
                self.gate.laser(setup.value, data, configured=bool(self._configuration))
                if setup.value == 2 and self.acquirer.state is State.FAULT:
                    self.acquirer.abandon(State.IDLE)
            case Request.HEARTBEAT:
                self.gate.heartbeat(u32(data))
            case Request.SET_WATCHDOG:
                expect_empty(data)
                self.gate.set_watchdog(setup.value)
            case Request.RESET:
                expect_empty(data)
                if setup.value != sbp.RESET_VALUE:
                    raise Refused(ErrorCode.BAD_VALUE, setup.value)
                self._reset()
            case _:
                raise Refused(ErrorCode.UNKNOWN_REQUEST, setup.request)

    def _set_config(self, data: bytes, *, check_only: bool) -> None:
        if self.acquirer.state is not State.IDLE:
            raise Refused(ErrorCode.BUSY, self.acquirer.state)
        configuration = check_configuration(data, self.caps)
        if not check_only:
            self._configuration = data
            self.acquirer.configure(configuration, int.from_bytes(data[-4:], "little"))

    def _set_windows(self, data: bytes, *, check_only: bool) -> None:
        if self.acquirer.state not in (State.IDLE, State.WAIT):
            raise Refused(ErrorCode.BUSY, self.acquirer.state)
        configuration = self.acquirer.configuration
        if configuration is None:
            raise Refused(ErrorCode.NOT_CONFIGURED)
        table = check_windows(data, configuration.prf_hz, self.caps)
        if not check_only:
            self.acquirer.set_windows(table)

    def _start(self, run_id: int) -> None:
        if self.acquirer.state is not State.IDLE:
            raise Refused(ErrorCode.BUSY, self.acquirer.state)
        if not self._configuration:
            raise Refused(ErrorCode.NOT_CONFIGURED)
        if run_id == 0:
            raise Refused(ErrorCode.BAD_VALUE)
        self.acquirer.start(run_id)

    def _reset(self) -> None:
        self.gate.reset()
        self.acquirer.reset()
        self._configuration = b""
        self.reports.clear()

    # Status

    def status(self) -> sbp.Status:
        """Get the status block."""
        acquirer = self.acquirer
        prf_hz = acquirer.prf_hz
        flags = {
            StatusFlag.INTERLOCK_CLOSED: self.interlock.closed,
            StatusFlag.TRIGGER_PRESENT: prf_hz > 0,
            StatusFlag.FRAMES_LOST: acquirer.queue.lost > 0,
            StatusFlag.WATCHDOG_TRIPPED: self.gate.watchdog_tripped,
            StatusFlag.CLIPPING_SEEN: acquirer.taker.clipping_seen,
            StatusFlag.CONFIGURED: bool(self._configuration),
            StatusFlag.CLOCK_LOCKED: self.clock_locked,
            StatusFlag.ERROR_QUEUED: len(self.reports) > 0,
        }
        return sbp.Status(
            state=acquirer.state,
            gate=self.gate.state,
            flags=StatusFlag(sum(bit for bit, on in flags.items() if on)),
            errors=len(self.reports),
            watchdog_ms=int(self.gate.left_s * 1000),
            run_id=acquirer.run_id,
            records=acquirer.records_done,
            frames_lost=acquirer.queue.lost,
            trigger_mhz=round(prf_hz * 1000),
            version=self.info.version,
        )

    def _gate_changed(self) -> None:
        self.reports.event(EventKind.GATE, self.gate.state)

    def _watchdog_tripped(self) -> None:
        self.reports.event(EventKind.WATCHDOG, 0, ErrorCode.WATCHDOG_TRIPPED)
        self.reports.error(ErrorCode.WATCHDOG_TRIPPED)
        self.acquirer.abandon(State.FAULT)

    def _interlock_changed(self) -> None:
        self.reports.event(EventKind.INTERLOCK, int(self.interlock.closed))
