"""`Connection`: the links of all devices, opened and closed together."""

from __future__ import annotations

from contextlib import suppress

from picoradar.drivers.errors import DeviceError, carry_out_all
from picoradar.drivers.interfaces import Identity
from picoradar.instrument.bench import Bench
from picoradar.instrument.controller.safety import STEP_OF, VERIFIED, SafeShutdown, SafeState, make_safe, words_of
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
            with self._shutdown.alone:
                # All, also after one has failed: the more links stand, the more can be switched off and read back.
                carry_out_all(*(device.open for device in self._bench.devices().values()))
                self._bench.pulser.configure(prf_hz=pulser.prf_hz, drive_v=pulser.drive_v)
                self.known = self._bench.identify()
            if found_on := self._bench.found_on():
                self._log.warning("was on when it was connected, is off now", found_on=list(found_on))
        except BaseException:
            self._shutdown()
            self.close()
            raise

    def close(self) -> None:
        """Close all links; one that cannot be closed in order does not keep the next one open."""
        with self._shutdown.alone:
            for name, device in self._bench.devices().items():
                try:
                    device.close()
                except DeviceError as error:
                    self._log.warning("close failed", device=name, error=str(error))
            self.is_open = False


def switch_off(bench: Bench) -> tuple[tuple[str, ...], SafeState]:
    """Bring everything to its safe state that can be reached, whatever it was found doing, and close the links.

    For a bench that a program has left behind: killed, or its computer gone.

    Returns
    -------
    found_on : tuple of str
        What was on: ``gate``, ``triggers``, ``supply``, ``diode``.
    SafeState
        What was verified; the steps of a device that could not be opened say why.
    """
    why: dict[str, str] = {}
    for name, device in bench.devices().items():
        try:
            device.open()
        except DeviceError as error:
            why[name] = words_of(error)
    found = bench.found_on()
    tried = make_safe(bench, diode_off=True).steps
    steps = {step: why.get(STEP_OF[step], said) if said != VERIFIED else said for step, said in tried.items()}
    for device in bench.devices().values():
        with suppress(DeviceError):
            device.close()
    return found, SafeState(steps)
