"""`Connection`: the links of all devices, opened and closed together."""

from __future__ import annotations

from picoradar.drivers.errors import DeviceError
from picoradar.drivers.interfaces import Identity
from picoradar.instrument.bench import Bench
from picoradar.instrument.controller.safety import SafeShutdown
from picoradar.instrument.events import Log
from picoradar.instrument.settings import PulserSettings


class Connection:
    """Opens all devices, or none.

    Parameters
    ----------
    bench : Bench
    shutdown : SafeShutdown
        Taken when the devices could not all be opened.
    log : structlog logger

    Attributes
    ----------
    known : dict of str to Identity
        Who answered when they were opened.
    is_open : bool
        Whether links may be open.
    """

    def __init__(self, bench: Bench, shutdown: SafeShutdown, log: Log) -> None:
        self.known: dict[str, Identity] = {}
        self.is_open = False
        self._bench = bench
        self._shutdown = shutdown
        self._log = log

    def open(self, pulser: PulserSettings) -> None:
        """Open all devices, everything off, and ask who they are.

        Raises
        ------
        DeviceError
            Of the first device that failed, with those of the others as notes; all are closed again.
        """
        self.is_open = True
        try:
            open_devices(self._bench)
            self._bench.pulser.configure(prf_hz=pulser.prf_hz, drive_v=pulser.drive_v)
            self.known = self._bench.identify()
        except BaseException:
            self._shutdown()
            self.close()
            raise

    def close(self) -> None:
        """Close all links; one that cannot be closed in order does not keep the next one open."""
        for name, device in self._bench.devices().items():
            try:
                device.close()
            except DeviceError as error:
                self._log.warning("close failed", device=name, error=str(error))
        self.is_open = False


def open_devices(bench: Bench) -> None:
    """Open all, also after one has failed: the more links stand, the more can be switched off and read back.

    Raises
    ------
    DeviceError
        Of the first device that failed, with those of the others as notes.
    """
    failures: list[DeviceError] = []
    for device in bench.devices().values():
        try:
            device.open()
        except DeviceError as error:
            failures.append(error)
    if failures:
        for other in failures[1:]:
            failures[0].add_note(f"and {other}")
        raise failures[0]
