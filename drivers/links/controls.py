"""Properties of a device as a table: key on the wire, kind, range, unit, docstring.

The class body of a driver then follows the command table of its protocol sheet. Ranges are strict: a value outside is
refused with the value and the range in the message, and nothing is sent.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, Protocol, TypeVar, overload

from picoradar.drivers.errors import LimitError, ProtocolError, check_range

K = TypeVar("K")
K_contra = TypeVar("K_contra", contravariant=True)
T = TypeVar("T", bound=float)

Limits = tuple[float, float]


class NumberTable(Protocol[K_contra]):
    """A device whose settings and readings are numbers under a key (mnemonic or parameter id)."""

    @property
    def device(self) -> str:
        """Get the device's name for messages."""

    def get_number(self, key: K_contra) -> float:
        """Query one number."""

    def set_number(self, key: K_contra, value: float) -> None:
        """Set one number."""


class Reading(Generic[K, T]):
    """A number that the device reports: ``Get the ...`` or ``Measure the ...``.

    Parameters
    ----------
    key : K
        Mnemonic or parameter id on the wire.
    kind : type
        ``float``, ``int``, ``bool`` or an ``IntEnum``: what the number is read as.
    doc : str
        The property's docstring.

    Raises
    ------
    ProtocolError
        On reading, when the device reports a number that is not of this kind.
    """

    def __init__(self, key: K, kind: type[T], doc: str) -> None:
        self.key = key
        self.kind = kind
        self.name = str(key)
        self.__doc__ = doc
        self._integral: bool = issubclass(kind, int)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, table: None, owner: type) -> Reading[K, T]: ...
    @overload
    def __get__(self, table: NumberTable[K], owner: type | None = None) -> T: ...
    def __get__(self, table: NumberTable[K] | None, owner: type | None = None) -> T | Reading[K, T]:
        if table is None:
            return self
        number = table.get_number(self.key)
        try:
            return self._as_kind(number)
        except ValueError as error:
            what = f"reports {self.name} {number:g}, which is no {self.kind.__name__}"
            raise ProtocolError(table.device, what) from error

    def _as_kind(self, number: float) -> T:
        """Convert a number to the kind; a fraction is never truncated to make an integer."""
        if not self._integral:
            return self.kind(number)
        if int(number) != number or (self.kind is bool and number not in (0, 1)):
            raise ValueError(f"{number} is no {self.kind.__name__}")
        return self.kind(int(number))


class Control(Reading[K, T]):
    """A number that can be set too: ``Control the ... in ... (kind from ... to ...)``.

    Parameters
    ----------
    key, kind, doc
        As in `Reading`.
    limits : (float, float) or callable, optional
        Minimum and maximum value, or a function of the device that returns them. An ``IntEnum`` needs none.
    unit : str, optional
        For the error message.

    Raises
    ------
    LimitError
        On setting a value out of range; nothing was sent.
    """

    def __init__(
        self, key: K, kind: type[T], doc: str, *, limits: Limits | Callable[..., Limits] | None = None, unit: str = ""
    ) -> None:
        super().__init__(key, kind, doc)
        self.limits = limits
        self.unit = unit

    def __set__(self, table: NumberTable[K], value: T) -> None:
        if self.limits is not None:
            minimum, maximum = self.limits(table) if callable(self.limits) else self.limits
            check_range(table.device, self.name, value, minimum, maximum, self.unit)
        try:
            number = self._as_kind(value)
        except ValueError as error:
            what = f"{self.name} {value!r} is no {self.kind.__name__}; nothing was sent"
            raise LimitError(table.device, what) from error
        table.set_number(self.key, number)
