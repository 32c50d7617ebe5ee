"""The errors of the drivers: what happened, to which device, in which state, and what to do."""

from __future__ import annotations

from collections.abc import Callable


class DeviceError(Exception):
    """Base class of all failures between the host and a device.

    Parameters
    ----------
    device : str
        Name of the device on the bench and how it is reached, for example ``"DG645 (COM3)"``.
    what : str
        What happened, with the value and the range where there is one.
    remedy : str, optional
        What a person can do about it.
    """

    def __init__(self, device: str, what: str, remedy: str = "") -> None:
        self.device = device
        self.what = what
        self.remedy = remedy
        super().__init__(f"{device}: {what}" + (f" ({remedy})" if remedy else ""))


class LinkLost(DeviceError):
    """The port or the USB device is not there, has gone, or may not be opened."""


class Timeout(DeviceError):
    """The device did not answer in time; the link itself still stands."""


class ProtocolError(DeviceError):
    """The device sent an answer that its protocol does not allow (bad check sum, wrong form)."""


class Stall(ProtocolError):
    """A USB endpoint is halted: the device refused the request."""


class DeviceFault(DeviceError):
    """The device reports an error or refuses a command, in a valid answer.

    Parameters
    ----------
    code : int or str, optional
        The device's own error code, as its protocol sheet names it.
    """

    def __init__(self, device: str, what: str, remedy: str = "", *, code: int | str | None = None) -> None:
        super().__init__(device, what, remedy)
        self.code = code


class LimitError(DeviceError, ValueError):
    """A value outside the device's range was asked for; nothing was sent."""


def check_range(device: str, quantity: str, value: float, minimum: float, maximum: float, unit: str = "") -> float:
    """Return ``value`` if it lies in the closed range from ``minimum`` to ``maximum``.

    Parameters
    ----------
    device : str
        The device's name for the message.
    quantity : str
        Name of the value for the message.
    value : float
    minimum, maximum : float
    unit : str, optional
        For the message.

    Raises
    ------
    LimitError
        With the value and the allowed range in the message. NaN and infinities are refused as well.
    """
    if not minimum <= value <= maximum:
        u = f" {unit}" if unit else ""
        raise LimitError(device, f"{quantity} {value:g}{u} is outside {minimum:g} to {maximum:g}{u}; nothing was sent")
    return float(value)


def carry_out_all(*steps: Callable[[], None]) -> None:
    """Carry out every step, then raise the error of the first that failed, with a note on each other one.

    Raises
    ------
    DeviceError
    """
    errors: list[DeviceError] = []
    for step in steps:
        try:
            step()
        except DeviceError as error:
            errors.append(error)
    if errors:
        for other in errors[1:]:
            errors[0].add_note(f"and {other}")
        raise errors[0]
