"""One serial link of a transcript as a device."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from picoradar.drivers.links import Event
from picoradar.sim.replay.script import Script


class SerialReplay:
    """A serial device that plays its part of a transcript; satisfies `picoradar.sim.ports.wire.SerialFirmware`.

    Parameters
    ----------
    events : sequence of Event
        A transcript.
    link : str
        Which of its links.
    """

    def __init__(self, events: Sequence[Event], link: str) -> None:
        self._script = Script(events, link, ("write", "read"))
        self.baud = int(self._script.opened.more["baud"])
        self._came = b""
        self._send: Callable[[bytes, float], None] | None = None

    @property
    def finished(self) -> bool:
        """Get whether the transcript has been played to its end."""
        return self._script.finished

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        """Take the function to answer with."""
        self._send = send

    def receive(self, data: bytes) -> None:
        """Take bytes from the host.

        Raises
        ------
        ReplayMismatch
            When they are not those of the transcript.
        """
        self._came += data
        while self._came:
            due = self._script.expect("write", f"write {self._came!r}").data
            if len(self._came) < len(due) and due.startswith(self._came):
                return
            if not self._came.startswith(due):
                raise self._script.refuse(f"write {self._came!r}")
            self._came = self._came[len(due) :]
            self._script.pass_on()
            self._answer(len(due))

    def _answer(self, sent: int) -> None:
        """Send what came before the host's next bytes, with the delay that it had in the transcript."""
        began_s, bytes_moved = self._script.last_s, sent
        while (event := self._script.next("read")) is not None:
            bytes_moved += len(event.data)
            after_s = event.time_s - began_s
            if event.more.get("ahead"):  # it was there before the host looked: half-way is in time for this host too
                after_s /= 2
            delay_s = after_s - 10 * bytes_moved / self.baud  # the line takes its time again
            if self._send is not None:
                self._send(event.data, max(0.0, delay_s))
            self._script.pass_on()
