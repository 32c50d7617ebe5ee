"""How long transfers take on the simulated bus.

Full speed has frames of 1 ms and moves at most 19 packets of 64 bytes in each; high speed has microframes of 125 us and
moves about 40 MB/s. A transfer ends with the frame in which its last packet moved; an interrupt endpoint is polled at
its interval.
"""

from __future__ import annotations

import math

from picoradar.drivers.clock import Clock
from picoradar.sim.usb import descriptors as d

_FRAME_S = {d.FULL_SPEED: 1e-3, d.HIGH_SPEED: 125e-6}
_BYTES_PER_S = {d.FULL_SPEED: 19 * 64 / 1e-3, d.HIGH_SPEED: 40e6}


class BusTiming:
    """Lets the time of transfers pass.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    speed : int
        libusb's number of the bus speed.
    """

    def __init__(self, clock: Clock, speed: int) -> None:
        self._clock = clock
        self._speed = speed
        self._frame_s = _FRAME_S[speed]
        self._bytes_per_s = _BYTES_PER_S[speed]

    def pass_frame(self, length: int = 0, endpoint: d.Endpoint | None = None) -> None:
        """Let the time of a transfer pass: that of its bytes, up to the end of a frame or polling interval."""
        period_s = self._frame_s
        if endpoint is not None and transfer_type(endpoint) == d.INTERRUPT:
            period_s *= 2 ** (endpoint.bInterval - 1) if self._speed == d.HIGH_SPEED else endpoint.bInterval
        now = self._clock.now()
        # The small term absorbs the rounding of a clock that is exactly at the end of a frame.
        frames = math.floor((now + length / self._bytes_per_s) / period_s + 1e-6) + 1
        self._clock.sleep(frames * period_s - now)


def transfer_type(endpoint: d.Endpoint) -> int:
    """Get whether an endpoint is isochronous, bulk or interrupt."""
    return endpoint.bmAttributes & 3
