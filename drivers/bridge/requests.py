"""Control requests of the sampling bridge, with the device's own reason when it refuses one.

Source: protocol sheet ``sampling_bridge.md``, section 2.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TypeVar

from picoradar.drivers.bridge.sbp import BadBlock, ErrorCode, ErrorEntry, Gate, Request, Status, StatusFlag
from picoradar.drivers.errors import DeviceFault, ProtocolError, Stall
from picoradar.drivers.interfaces import SamplerStatus
from picoradar.drivers.links import UsbLink

_Block = TypeVar("_Block")
_GATES = {Gate.OFF: "off", Gate.ON: "on", Gate.LOCKED: "locked"}


class BridgeRequests:
    """Requests over one link.

    Parameters
    ----------
    link : UsbLink

    Attributes
    ----------
    noted : deque of ErrorEntry
        Errors that no request caused, read from the device and not yet reported.
    """

    def __init__(self, link: UsbLink) -> None:
        self.link = link
        self.noted: deque[ErrorEntry] = deque(maxlen=16)

    def status(self) -> Status:
        """Get the status block."""
        return self.block(Request.GET_STATUS, 64, Status.decode)

    def block(self, request: Request, size: int, decode: Callable[[bytes], _Block]) -> _Block:
        """Get a block of the device.

        Parameters
        ----------
        request : Request
        size : int
            Largest answer, bytes.
        decode : callable
            Makes the block from its bytes.

        Raises
        ------
        ProtocolError
            When length, version or check sum are wrong.
        """
        try:
            return decode(self.link.control_in(request, 0, size))
        except BadBlock as error:
            raise ProtocolError(self.link.device, f"answer to {request.name}: {error}") from error

    def order(self, request: Request, value: int, data: bytes = b"") -> None:
        """Send a request that changes the state of the device.

        Parameters
        ----------
        request : Request
        value : int
            wValue.
        data : bytes
            Data stage.

        Raises
        ------
        DeviceFault
            When the device refuses it; ``code`` and text come from its error queue.
        """
        try:
            self.link.control_out(request, value, data)
        except Stall as stall:
            reason: ErrorEntry | None = None
            for entry in self.errors():
                if entry.request == request:
                    reason = entry
                else:
                    self.noted.append(entry)
            if reason is None:
                raise DeviceFault(self.link.device, f"refused {request.name} without a reason") from stall
            raise DeviceFault(self.link.device, f"refused {request.name}: {reason}", code=reason.code) from stall

    def errors(self) -> list[ErrorEntry]:
        """Read the error queue empty."""
        entries: list[ErrorEntry] = []
        for _ in range(64):  # the queue is 16 deep; do not wait for a device that keeps reporting errors
            entry = self.block(Request.GET_ERROR, 8, ErrorEntry.decode)
            if entry.code == ErrorCode.OK:
                break
            entries.append(entry)
        return entries


def gate_name(gate: Gate) -> str:
    """Get the controller's name for a state of the gate."""
    return _GATES[gate]


def sampler_status(status: Status, problem: str) -> SamplerStatus:
    """Make the status for the controller from a status block."""
    return SamplerStatus(
        state=status.state.name.lower(),
        gate=gate_name(status.gate),
        interlock_closed=bool(status.flags & StatusFlag.INTERLOCK_CLOSED),
        trigger_present=bool(status.flags & StatusFlag.TRIGGER_PRESENT),
        trigger_hz=status.trigger_mhz / 1000,
        watchdog_left_s=status.watchdog_ms / 1000,
        problem=problem,
        clock_locked=bool(status.flags & StatusFlag.CLOCK_LOCKED),
    )
