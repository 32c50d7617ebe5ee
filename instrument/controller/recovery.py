"""Link loss as a state: find out which device is away, open it anew, and bring it back to where it was."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from picoradar.drivers.errors import DeviceError, LinkLost, ProtocolError, Timeout
from picoradar.drivers.interfaces import Identity
from picoradar.instrument.bench import Bench
from picoradar.instrument.controller.job import ScanJob
from picoradar.instrument.errors import InterlockTripped
from picoradar.instrument.events import Log
from picoradar.instrument.settings import Settings

LINK_ERRORS = (LinkLost, Timeout, ProtocolError)
FIRST_WAIT_S, LONGEST_WAIT_S = 0.1, 5.0
LIMIT_S = 60.0  # a link that stays away for longer ends the scan


def waits() -> Iterator[float]:
    """Make the back-off (s), endless: 0.1 s, each wait twice the one before, at most 5 s."""
    wait_s = FIRST_WAIT_S
    while True:
        yield wait_s
        wait_s = min(2 * wait_s, LONGEST_WAIT_S)


def reopen(bench: Bench, settings: Settings, known: Mapping[str, Identity], log: Log) -> None:
    """Open every device that does not answer, check that it is the same one, and keep the diode at its temperature.

    Parameters
    ----------
    bench : Bench
    settings : Settings
    known : mapping of str to Identity
        Who answered when the bench was connected.
    log : structlog logger

    Raises
    ------
    DeviceError
        While a device is still away.
    InterlockTripped
        When another device than before answers.
    """
    for name, device in bench.devices().items():
        if _answers(bench, name):
            continue
        _close(device, name, log)
        device.open()
        found = device.identify()
        if found != known[name]:
            raise InterlockTripped(
                "identity", f"{name} is now {found}, it was {known[name]}; put the cables back and start anew"
            )
        log.info("link is back", device=name)
    diode = bench.diode.status()
    if not diode.regulating and not diode.problem:
        bench.diode.regulate(settings.diode.target_degc)


def apply_settings(bench: Bench, settings: Settings, job: ScanJob) -> None:
    """Bring pulser and sampler to what a scan needs, all off and read back.

    To both, whichever was away: a device that lost its power answers as before and has forgotten everything. A
    lock-out of the gate is ended here, on purpose: all interlocks hold, and a person or a recovery wants light.

    Parameters
    ----------
    bench : Bench
    settings : Settings
    job : ScanJob
        Knows how records are taken.

    Raises
    ------
    DeviceError
    """
    if bench.sampler.status().gate == "locked":
        bench.sampler.clear_lockout()
    bench.pulser.configure(prf_hz=settings.pulser.prf_hz, drive_v=settings.pulser.drive_v)
    job.configure(bench.sampler)


def _answers(bench: Bench, name: str) -> bool:
    ask = {
        "sampler": bench.sampler.status,
        "pulser": bench.pulser.status,
        "diode": bench.diode.status,
        "galvo": bench.galvo.ready,
    }[name]
    try:
        ask()
    except LINK_ERRORS:
        return False
    return True


def _close(device: Any, name: str, log: Log) -> None:
    try:
        device.close()
    except DeviceError as error:
        log.info("close failed", device=name, error=str(error))
