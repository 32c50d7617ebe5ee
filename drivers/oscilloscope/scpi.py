"""SCPI commands to the oscilloscope: settings with read-back, queries, the error queue."""

from __future__ import annotations

import math

from picoradar.drivers.errors import DeviceFault, ProtocolError
from picoradar.drivers.links import Usbtmc


class ScpiSession:
    """Commands in ASCII over USBTMC.

    Parameters
    ----------
    tmc : Usbtmc
        Messages to the instrument.
    """

    def __init__(self, tmc: Usbtmc) -> None:
        self._tmc = tmc

    @property
    def device(self) -> str:
        """Get the device's name for messages."""
        return self._tmc.link.device

    def write(self, command: str) -> None:
        """Send a command."""
        self._tmc.write(command.encode("ascii") + b"\n")

    def query(self, query: str) -> str:
        """Send a query and get its answer."""
        return self._tmc.query(query.encode("ascii") + b"\n").decode("ascii", "replace").strip()

    def set(self, header: str, value: float) -> None:
        """Set a number and read it back.

        Parameters
        ----------
        header : str
            SCPI header, with its leading colon.
        value : float

        Raises
        ------
        ProtocolError
            When the answer is not a number.
        DeviceFault
            When the instrument has refused or rounded the value.
        """
        self.write(f"{header} {value:.9G}")
        answer = self.query(f"{header}?")
        try:
            found = float(answer)
        except ValueError as error:
            raise ProtocolError(self.device, f"{header}? was answered with {answer!r}") from error
        if not math.isclose(found, value, rel_tol=1e-7, abs_tol=1e-15):
            raise DeviceFault(self.device, f"{header} reads back as {found:g} after {value:g} was set")

    def errors(self) -> list[str]:
        """Read the error queue empty."""
        errors: list[str] = []
        for _ in range(64):  # do not wait for an instrument that keeps reporting errors
            answer = self.query(":SYSTem:ERRor?")
            if answer.split(",")[0].strip() in ("0", "+0"):
                break
            errors.append(answer)
        return errors

    def check_errors(self) -> None:
        """Make sure that no error was reported.

        Raises
        ------
        DeviceFault
            With all errors; ``code`` is the first one's.
        """
        if errors := self.errors():
            raise DeviceFault(self.device, "reports " + "; ".join(errors), code=errors[0].split(",")[0])
