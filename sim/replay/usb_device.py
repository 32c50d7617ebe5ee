"""One USB link of a transcript as a device."""

from __future__ import annotations

from collections.abc import Sequence

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.links import Event, EventDetails, InterfaceDetails
from picoradar.sim.replay.script import Script
from picoradar.sim.usb import HIGH_SPEED, Configuration, Device, Endpoint, Interface, Setup, UsbStall


class UsbReplay:
    """A USB device that plays its part of a transcript; satisfies `picoradar.sim.usb.UsbFirmware`.

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
        self._script = Script(events, link, ("control", "write", "read", "clear_halt"))
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
        if any(event.more.get(key) != value for key, value in asked.items()):
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
        """Ignore it: a transcript has no configurations."""

    def alternate_selected(self, interface: int, alternate: int) -> None:
        """Ignore it: a transcript begins after it."""

    def halt_cleared(self, endpoint: int) -> None:
        """Play the transcript's next clearing of a halt."""
        self._played(self._script.expect("clear_halt", f"clear the halt of endpoint {endpoint:#04x}"))

    def bus_reset(self) -> None:
        """Ignore it."""

    def _played(self, event: Event) -> bytes:
        self._script.pass_on()
        self._last_s = self.clock.now()
        if event.more.get("error") == "stall":
            raise UsbStall("as in the transcript")
        return event.data


def _descriptors(opened: EventDetails) -> Device:
    """Make the descriptors of the device in the transcript."""
    interfaces = tuple(_interface(details) for details in opened["interfaces"])
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


def _interface(details: InterfaceDetails) -> Interface:
    endpoints = tuple(Endpoint(address, kind, size, interval) for address, kind, size, interval in details["endpoints"])
    kind, subclass, protocol = details["class"]
    return Interface(endpoints, details["number"], details["alternate"], kind, subclass, protocol)


def _nothing() -> None:
    pass
