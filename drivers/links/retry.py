"""Retries when an answer is lost or corrupted on the line."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from picoradar.drivers.errors import ProtocolError, Timeout

T = TypeVar("T")


def retry(tries: int, attempt: Callable[[], T]) -> T:
    """Carry out ``attempt``, and again when its answer is lost or corrupted.

    Only for what may safely be done twice: a query that does not change what it reads, or a setting.

    Parameters
    ----------
    tries : int
        Number of attempts, at least 1.
    attempt : callable
        One exchange.

    Raises
    ------
    Timeout, ProtocolError
        Of the last attempt. All other errors are raised at once.
    """
    for _ in range(tries - 1):
        try:
            return attempt()
        except (Timeout, ProtocolError):
            continue
    return attempt()
