"""The galvo controller: two mirrors."""

from __future__ import annotations

from typing import Protocol

from picoradar.drivers.interfaces.device import Device


class Galvo(Device, Protocol):
    """Two mirrors, moved by integer codes."""

    @property
    def codes(self) -> int:
        """Get the number of codes an axis has; the centre is ``codes // 2``."""

    def move(self, x_code: int, y_code: int) -> None:
        """Send the beam to a position; returns when the controller has accepted it (the mirrors still settle)."""

    def ready(self) -> bool:
        """Get whether the controller answers and can accept the next position."""

    def park(self) -> None:
        """Send the mirrors to the centre, and verify that the controller has done so."""
