"""Status registers and error queue of the simulated DG645 (protocol sheet ``dg645``, registers and error codes)."""

from __future__ import annotations

from collections import deque

from picoradar.drivers.dg645 import QUEUE_LENGTH

OPC, QYE, DDE, EXE, CME, PON = 0x01, 0x04, 0x08, 0x10, 0x20, 0x80
OVERFLOW = 254


class Refused(Exception):
    """A command is refused with an error code of the sheet."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class Registers:
    """ESR, INSR, their masks and the queue of 20 error codes."""

    def __init__(self) -> None:
        self.esr = PON
        self.insr = 0
        self.masks = {"*ESE": 0, "*SRE": 0, "*PSC": 1, "INSE": 0}
        self._errors: deque[int] = deque()

    def clear(self) -> None:
        """Carry out ``*CLS``."""
        self.esr = 0
        self.insr = 0
        self._errors.clear()

    def put_error(self, code: int) -> None:
        """Queue an error; when the queue is full its last entry becomes 254."""
        self.esr |= _event_of(code)
        if len(self._errors) < QUEUE_LENGTH:
            self._errors.append(code)
        else:
            self._errors[-1] = OVERFLOW

    def take_error(self) -> int:
        """Remove and return the oldest error; 0 for none."""
        return self._errors.popleft() if self._errors else 0

    def take_esr(self, mask: int) -> int:
        """Return the bits of the ESR that are asked for, and clear these."""
        value = self.esr & mask
        self.esr &= ~mask
        return value

    def take_insr(self, mask: int) -> int:
        """Return the bits of the INSR that are asked for, and clear these."""
        value = self.insr & mask
        self.insr &= ~mask
        return value

    def status_byte(self, *, busy: bool, burst: bool) -> int:
        """Compute the STB from the registers and their masks."""
        stb = bool(self.insr & self.masks["INSE"]) | busy << 1 | burst << 2 | bool(self.esr & self.masks["*ESE"]) << 5
        return stb | bool(stb & self.masks["*SRE"]) << 6


def _event_of(code: int) -> int:
    """Which ESR bit an error code sets."""
    if code in (30, 32):
        return QYE
    if code >= 110 and code < OVERFLOW:
        return CME
    if 40 <= code < 60 or code in (16, 17, OVERFLOW):
        return DDE
    return EXE
