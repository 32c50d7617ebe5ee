"""Frame queue of the sampling bridge: sequence numbers, overruns, and frames corrupted by injected faults.

Source: protocol sheet ``sampling_bridge.md``, section 3, framing rules 4 and 5.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from picoradar.drivers.bridge.sbp import Caps, Frame, FrameFlag, encode_frame


class FrameQueue:
    """Frames between the acquisition and the host.

    Parameters
    ----------
    caps : Caps
        Depth of the queue and length of the header.
    overrun : callable
        Called with the number of frames lost so far when one more is lost.

    Attributes
    ----------
    lost : int
        Frames lost in this run.
    corrupted : bool
        Whether any frame of this run was lost, altered or discarded.
    fault : callable, optional
        ``fault(frame_bytes)`` returns what is queued in its place, or None to lose it; set by injected faults.
    """

    def __init__(self, caps: Caps, overrun: Callable[[int], None]) -> None:
        self.lost = 0
        self.corrupted = False
        self.fault: Callable[[bytes], bytes | None] | None = None
        self._caps = caps
        self._overrun = overrun
        self._frames: deque[bytes] = deque()
        self._sequence = 0
        self._lost_before = False

    def __len__(self) -> int:
        return len(self._frames)

    def restart(self) -> None:
        """Empty the queue for a new run."""
        self._frames.clear()
        self.lost = self._sequence = 0
        self.corrupted = self._lost_before = False

    def flush(self) -> None:
        """Discard the queued frames."""
        self.corrupted = self.corrupted or bool(self._frames)
        self._frames.clear()

    def take(self) -> bytes | None:
        """Give the oldest frame."""
        return self._frames.popleft() if self._frames else None

    def put(self, frame: Frame) -> None:
        """Queue a frame under the next sequence number; a full queue drops this newest one."""
        flags = frame.flags | (FrameFlag.LOST_BEFORE if self._lost_before else 0)
        data = encode_frame(frame._replace(sequence=self._sequence, flags=int(flags)), self._caps.header_length)
        self._sequence += 1
        queued = data if self.fault is None else self.fault(data)
        if len(self._frames) >= self._caps.queue_depth:
            queued = None
        self.corrupted = self.corrupted or queued != data
        self._lost_before = queued is None
        if queued is None:
            self.lost += 1
            self._overrun(self.lost)
        else:
            self._frames.append(queued)
