"""`BenchServer`: the whole simulated bench for other programs, in one thread."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self, TypedDict

from picoradar.sim.bench import SimulatedBench
from picoradar.sim.server.event_loop import EventLoop
from picoradar.sim.server.folder_lock import FolderLock
from picoradar.sim.server.served_port import PortAddresses, ServedPort
from picoradar.sim.server.usb_server import UsbServer

USB_BACKEND = "picoradar.sim.usb.forward:backend"


class Addresses(TypedDict):
    """Where hosts find the devices: serial ones by name; for USB the backend's name and its argument."""

    serial: dict[str, PortAddresses]
    usb: dict[str, str]


class BenchServer:
    """Serves a bench on ptys, TCP ports and forwarded USB, all on this computer only.

    Parameters
    ----------
    bench : SimulatedBench
        What to serve; its clock belongs to the server from now on.
    folder : Path
        Folder in which the ptys get their names; it belongs to this server until `close`.
    speed : float
        Seconds of the bench per second of wall time.
    ptys : bool
        Whether to make ptys; Windows has none, only the TCP ports.

    Raises
    ------
    FolderInUse
        When a server that is alive has that folder.
    OSError
        When a port, a terminal or its name cannot be had.

    Attributes
    ----------
    ports : dict
        `ServedPort` of each serial device by its name.
    """

    def __init__(
        self, bench: SimulatedBench, folder: Path, *, speed: float = 1.0, ptys: bool = os.name == "posix"
    ) -> None:
        with ExitStack() as undo:  # in the order of use backwards, here when something cannot be had, else in `close`
            lock = FolderLock(folder)
            undo.callback(lock.release)
            self.loop = EventLoop(bench.clock, speed)
            undo.callback(self.loop.close)
            self.ports: dict[str, ServedPort] = {}
            for name, wire in bench.wires.items():
                self.ports[name] = ServedPort(wire, self.loop, folder / name if ptys else None)
                undo.callback(self.ports[name].close)
            self._usb = UsbServer(bench.usb_backend, self.loop)
            undo.callback(self._usb.close)
            self._undo = undo.pop_all()

    def addresses(self) -> Addresses:
        """Get where hosts find the devices: ``serial`` by name, and ``usb`` (``backend`` and ``address``)."""
        return {
            "serial": {name: port.addresses for name, port in self.ports.items()},
            "usb": {"backend": USB_BACKEND, "address": self._usb.address},
        }

    def serve(self, until: Callable[[], bool]) -> None:
        """Serve until ``until()`` holds; it is called at least ten times a second."""
        while not until():
            self.loop.turn()

    def close(self) -> None:
        """Take all ports and their names away, and give the folder up."""
        self._undo.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()
