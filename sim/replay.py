"""A recorded transcript as devices: what the host sent is expected byte for byte, what came back is sent again.

With it a bug report becomes a test: the same driver calls meet the same bytes at the same device times.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from drivers.clock import VirtualClock
from drivers.transcript import Event, read_transcript
from sim.ports import SerialWire, new_bench_name, publish, withdraw
from sim.usb.backend import SimUsbBackend
from sim.usb.descriptors import HIGH_SPEED, Configuration, Device, Endpoint, Interface
from sim.usb.firmware import Setup, UsbStall


class ReplayMismatch(Exception):
    """The host did something else than in the transcript."""


class _Script:
    """The events of one link in their order, and how far the host has come."""

    def __init__(self, events: Sequence[Event], link: str, kinds: tuple[str, ...]) -> None:
        self.opened = next(e for e in events if e.link == link and e.what == "open")
        self._events = [e for e in events if e.link == link and e.what in kinds]
        self._link = link
        self._done = 0
        self.last_s = self.opened.time_s

    @property
    def finished(self) -> bool:
        return self._done == len(self._events)

    def next(self, what: str) -> Event | None:
        """Get the next event if it is of this kind."""
        event = None if self.finished else self._events[self._done]
        return event if event is not None and event.what == what else None

    def expect(self, what: str, came: str) -> Event:
        """Get the next event, which has to be of this kind."""
        event = self.next(what)
        if event is None:
            due = "nothing more" if self.finished else _told(self._events[self._done])
            raise ReplayMismatch(f"{self._link}, event {self._done + 1}: the transcript has {due}, the host did {came}")
        return event

    def refuse(self, came: str) -> ReplayMismatch:
        """Make the error of an event whose content differs."""
        told = _told(self._events[self._done])
        return ReplayMismatch(f"{self._link}, event {self._done + 1}: the transcript has {told}, the host did {came}")

    def pass_on(self) -> None:
        self.last_s = self._events[self._done].time_s
        self._done += 1


class SerialReplay:
    """A serial device that plays its part of a transcript; satisfies `sim.ports.SerialFirmware`.

    Parameters
    ----------
    events : sequence of Event
        A transcript.
    link : str
        Which of its links.
    """

    def __init__(self, events: Sequence[Event], link: str) -> None:
        self._script = _Script(events, link, ("write", "read"))
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
        """Send what came before the host's next bytes, as long after the last ones as it did then."""
        began_s, bytes_moved = self._script.last_s, sent
        while (event := self._script.next("read")) is not None:
            bytes_moved += len(event.data)
            delay_s = event.time_s - began_s - 10 * bytes_moved / self.baud  # the line takes its time again
            if self._send is not None:
                self._send(event.data, max(0.0, delay_s))
            self._script.pass_on()


class UsbReplay:
    """A USB device that plays its part of a transcript; satisfies `sim.usb.UsbFirmware`.

    Parameters
    ----------
    events : sequence of Event
        A transcript.
    link : str
        Which of its links.
    clock : VirtualClock
        Time of the replay.
    """

    def __init__(self, events: Sequence[Event], link: str, clock: VirtualClock) -> None:
        self._script = _Script(events, link, ("control", "write", "read", "clear_halt"))
        self.descriptors = _descriptors(self._script.opened.more)
        self.clock = clock
        self._half_frame_s = 62.5e-6 if self.descriptors.speed == HIGH_SPEED else 0.5e-3
        self._last_s = clock.now()

    @property
    def finished(self) -> bool:
        """Get whether the transcript has been played to its end."""
        return self._script.finished

    def control(self, setup: Setup, data: bytes) -> bytes:
        """Carry out the transcript's next control request."""
        came = f"request {setup} {data.hex()}"
        event = self._script.expect("control", came)
        asked = {"kind": setup.request_type, "request": setup.request, "value": setup.value, "index": setup.index}
        if any(event.more[key] != value for key, value in asked.items()):
            raise self._script.refuse(came)
        if not setup.to_host and event.data != data:
            raise self._script.refuse(came)
        return self._played(event) if setup.to_host else self._played(event)[:0]

    def receive(self, endpoint: int, data: bytes) -> bool:
        """Take the transcript's next OUT transfer."""
        came = f"write {data.hex()} to endpoint {endpoint:#04x}"
        event = self._script.expect("write", came)
        if (event.more["endpoint"], event.data) != (endpoint, data):
            raise self._script.refuse(came)
        self._played(event)
        return True

    def take(self, endpoint: int) -> bytes | None:
        """Give the next IN transfer when its time has come."""
        event = self._script.next("read")
        if event is None or event.more["endpoint"] != endpoint:
            return None
        due = self._last_s + event.time_s - self._script.last_s - self._half_frame_s  # the bus rounds up to a frame
        if due > self.clock.now():
            self.clock.call_at(due, _nothing)  # the bus looks again then
            return None
        return self._played(event)

    def configured(self, value: int) -> None:
        """Take note of nothing: a transcript has no configurations."""

    def alternate_selected(self, interface: int, alternate: int) -> None:
        """Take note of nothing: a transcript begins after it."""

    def halt_cleared(self, endpoint: int) -> None:
        """Play the transcript's next clearing of a halt."""
        self._played(self._script.expect("clear_halt", f"clear the halt of endpoint {endpoint:#04x}"))

    def bus_reset(self) -> None:
        """Take note of nothing."""

    def _played(self, event: Event) -> bytes:
        self._script.pass_on()
        self._last_s = self.clock.now()
        if event.more.get("error") == "stall":
            raise UsbStall("as in the transcript")
        return event.data


class ReplayedBench:
    """All devices of a transcript, in process, on the virtual clock.

    Parameters
    ----------
    path : Path
        The transcript.
    clock : VirtualClock, optional
        A new one by default.

    Attributes
    ----------
    urls : dict
        URL of each serial device by the name that it has in the transcript.
    usb_backend : SimUsbBackend
        pyusb backend that finds the USB devices.

    Raises
    ------
    ValueError
        When the file is no transcript.
    """

    def __init__(self, path: Path, clock: VirtualClock | None = None) -> None:
        events = read_transcript(path)
        self.clock = VirtualClock() if clock is None else clock
        opened = {e.link: e.more for e in events if e.what == "open"}
        self.serial = {link: SerialReplay(events, link) for link, more in opened.items() if "baud" in more}
        self.usb = {link: UsbReplay(events, link, self.clock) for link, more in opened.items() if "baud" not in more}
        name = new_bench_name()
        self.urls = {
            link: publish(name, str(number), SerialWire(device, self.clock))
            for number, (link, device) in enumerate(self.serial.items())
        }
        self.usb_backend = SimUsbBackend(self.clock, self.usb.values())

    @property
    def finished(self) -> bool:
        """Get whether every device has played its part to the end."""
        return all(device.finished for device in (*self.serial.values(), *self.usb.values()))

    def close(self) -> None:
        """Take the ports away."""
        for url in self.urls.values():
            withdraw(url)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()


def _told(event: Event) -> str:
    where = f" on endpoint {event.more['endpoint']:#04x}" if "endpoint" in event.more else ""
    return f"{event.what} {event.data!r}{where} at {event.time_s:g} s"


def _descriptors(opened: dict[str, Any]) -> Device:
    """Make a device like the one of the transcript."""
    interfaces = tuple(
        Interface(tuple(Endpoint(*e) for e in i["endpoints"]), i["number"], i["alternate"], *i["class"])
        for i in opened["interfaces"]
    )
    strings = [text or "" for text in opened["strings"]]
    return Device(
        opened["idVendor"],
        opened["idProduct"],
        opened["bcdDevice"],
        (Configuration(interfaces),),
        strings=tuple(strings),
        iManufacturer=1,
        iProduct=2,
        iSerialNumber=3 if strings[2] else 0,
        speed=opened["speed"],
    )


def _nothing() -> None:
    pass
