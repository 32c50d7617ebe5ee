"""Delay channels of the simulated DG645: a tree of links on a grid of 5 ps."""

from __future__ import annotations

from decimal import ROUND_HALF_EVEN, Decimal

from picoradar.sim.firmware.dg645.registers import Refused

T0, T1, FIRST, LAST = 0, 1, 2, 9
GRID_PS = 5
LONGEST_PS = 2000 * 10**12
DEFAULT_WIDTH_PS = 10_000
ILLEGAL_VALUE, ILLEGAL_DELAY, ILLEGAL_LINK = 10, 12, 13


class DelayTree:
    """Channels A to H (2..9), each a delay after another one."""

    def __init__(self) -> None:
        self.reference = dict.fromkeys(range(FIRST, LAST + 1), T0)
        self.delay_ps = dict.fromkeys(range(FIRST, LAST + 1), 0)
        for leading in range(FIRST, LAST, 2):  # A, C, E, G: each output is a pulse from one edge to the next
            self.reference[leading + 1], self.delay_ps[leading + 1] = leading, DEFAULT_WIDTH_PS

    def set(self, channel: int, reference: int, delay_s: Decimal) -> None:
        """Carry out ``DLAY``; a delay may be negative while the instant is not. Refused, it changes nothing.

        Parameters
        ----------
        channel, reference : int
            The channel, and the one that its delay counts from.
        delay_s : Decimal

        Raises
        ------
        Refused
            With the error code of the sheet.
        """
        self._check_link(channel, reference)
        before = self.reference[channel], self.delay_ps[channel]
        self.reference[channel] = reference
        self.delay_ps[channel] = to_grid(delay_s)
        if any(not 0 <= self.instant_ps(c) <= LONGEST_PS for c in self.reference):
            self.reference[channel], self.delay_ps[channel] = before
            raise Refused(ILLEGAL_DELAY)

    def link(self, channel: int, reference: int) -> None:
        """Carry out ``LINK``: another reference, the same instant (by command *unverified*)."""
        self._check_link(channel, reference)
        self.delay_ps[channel] = self.instant_ps(channel) - self.instant_ps(reference)
        self.reference[channel] = reference

    def instant_ps(self, channel: int) -> int:
        """Compute when a channel's edge comes after T0."""
        total = 0
        while channel != T0:
            total += self.delay_ps[channel]
            channel = self.reference[channel]
        return total

    @property
    def longest_s(self) -> float:
        """Get the end of the longest delay (T1)."""
        return max(self.instant_ps(channel) for channel in self.reference) / 1e12

    def text(self, channel: int) -> str:
        """Write the reply to ``DLAY?``."""
        if channel in (T0, T1):
            ps = round(self.longest_s * 1e12) if channel == T1 else 0
            return f"{T0},{seconds_text(ps)}"
        return f"{self.reference[channel]},{seconds_text(self.delay_ps[channel])}"

    def _check_link(self, channel: int, reference: int) -> None:
        if not FIRST <= channel <= LAST:
            raise Refused(ILLEGAL_VALUE)
        if reference == T1:
            raise Refused(ILLEGAL_LINK)
        while reference != T0:
            if reference == channel:
                raise Refused(ILLEGAL_LINK)
            reference = self.reference[reference]


def to_grid(delay_s: Decimal) -> int:
    """Round a time to the nearest multiple of 5 ps, in ps."""
    return GRID_PS * int((delay_s * 10**12 / GRID_PS).to_integral_value(ROUND_HALF_EVEN))


def seconds_text(ps: int) -> str:
    """Write a time with sign and twelve decimals, as the device does."""
    return f"{Decimal(ps) / 10**12:+.12f}"
