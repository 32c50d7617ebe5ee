"""The errors of a serial port, and what the person at the bench can do about them."""

from __future__ import annotations

import errno
import os
import sys

import serial


def port_errors() -> tuple[type[Exception], ...]:
    """Get what a port may raise: exceptions of pyserial, of the operating system and, on POSIX, of termios."""
    try:
        import termios
    except ImportError:
        return (serial.SerialException, OSError)
    return (serial.SerialException, OSError, termios.error)


def remedy_for(url: str, error: BaseException) -> str:
    """Say what to do about an error of opening a serial port.

    Parameters
    ----------
    url : str
        Port name or URL, as in the settings.
    error : exception
        What pyserial, termios or the operating system raised.
    """
    match _number_of(error):
        case errno.EACCES | errno.EPERM if sys.platform == "win32":
            return "another program has it open: close that one"
        case errno.EACCES | errno.EPERM:
            return _permission(url)
        case errno.ENOENT | errno.ENODEV | errno.ENXIO:
            return "no such port: check the name in the settings, and that the device is plugged in and switched on"
        case errno.EBUSY | errno.EAGAIN:
            return "another program has it open: close that one"
        case errno.ECONNREFUSED:
            return "nothing listens at that address: start the server (picoradar sim, or the serial-to-network adapter)"
        case errno.ENOTTY | errno.EINVAL:
            return "that is no serial port: check the name in the settings"
    return "check that it is plugged in and that no other program has it open"


def _number_of(error: BaseException) -> int | None:
    """Get the operating system's number of an error; pyserial often keeps it only in what it was raised from."""
    number = getattr(error, "errno", None)
    if number is None and error.args and isinstance(error.args[0], int):
        number = error.args[0]  # termios.error
    if number is None and error.__context__ is not None:
        return _number_of(error.__context__)
    return number


def _permission(url: str) -> str:
    group = _group_of(url)
    return (
        f"the port exists, but this account is not in its group {group!r}: "
        f"sudo usermod -aG {group} $USER, then log in again"
    )


def _group_of(url: str) -> str:
    if sys.platform == "win32":
        return ""
    import grp

    try:
        return grp.getgrgid(os.stat(url).st_gid).gr_name
    except (OSError, KeyError):
        return "dialout"
