"""All devices of a transcript."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.errors import DECODER_ERRORS, decoder_words
from picoradar.drivers.links import read_transcript
from picoradar.sim.ports import SerialWire, new_bench_name, publish, withdraw
from picoradar.sim.replay.serial_device import SerialReplay
from picoradar.sim.replay.usb_device import UsbReplay
from picoradar.sim.usb import SimUsbBackend


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
        try:
            self.serial = {link: SerialReplay(events, link) for link, more in opened.items() if "baud" in more}
            self.usb = {
                link: UsbReplay(events, link, self.clock) for link, more in opened.items() if "baud" not in more
            }
        except DECODER_ERRORS as error:
            raise ValueError(f"{path}: what it says of a device is damaged: {decoder_words(error)}") from error
        name = new_bench_name()
        self.urls = {
            link: publish(name, str(number), SerialWire(device, self.clock))
            for number, (link, device) in enumerate(self.serial.items())
        }
        self.usb_backend = SimUsbBackend(self.clock, self.usb.values())

    @property
    def finished(self) -> bool:
        """Get whether every device has played its part to the end."""
        return all(d.finished for d in self.serial.values()) and all(d.finished for d in self.usb.values())

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
