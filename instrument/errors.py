"""What can go wrong above the drivers, and the exit status that each kind has on the command line."""

from __future__ import annotations


class PicoradarError(Exception):
    """Base of the instrument's own errors; the message is one line for a person."""

    exit_status = 1


class BadInput(PicoradarError, ValueError):
    """A file, setting or argument cannot be used; says which, what was found, what to do."""

    exit_status = 2


class NotAllowed(PicoradarError):
    """A verb that the controller's present state does not allow; says which are allowed."""

    exit_status = 2


class InterlockTripped(PicoradarError):
    """An interlock or an emergency off has stopped the laser; the safe state has been reached.

    Parameters
    ----------
    interlock : str
        Name of the interlock.
    message : str
        Value, band and what to do.
    action : str
        ``suspend``: laser off until it holds again; ``abort``: the scan ends; ``off``: that, and the diode's
        controller is switched off too.
    """

    exit_status = 4

    def __init__(self, interlock: str, message: str, *, action: str = "abort") -> None:
        self.interlock = interlock
        self.action = action
        super().__init__(f"interlock '{interlock}': {message}")


class Interrupted(PicoradarError):
    """A person stopped the work (Ctrl-C, SIGTERM); the safe state has been reached."""

    exit_status = 130
