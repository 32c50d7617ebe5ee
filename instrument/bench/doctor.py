"""Examines every device of a bench by itself: identity, state and limits. The laser stays off.

Opening a device brings it to its safe state, which its driver verifies; nothing that could give light is switched on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Protocol, TypeVar

from picoradar.drivers.bridge import sbp
from picoradar.drivers.errors import DeviceError, ProtocolError, Timeout
from picoradar.drivers.helios import wire as helios_wire
from picoradar.drivers.interfaces import Device
from picoradar.drivers.oscilloscope import driver as oscilloscope
from picoradar.instrument.bench import device_checks as checks
from picoradar.instrument.bench.opening import DeviceMaker
from picoradar.instrument.bench.port_probe import identify_port
from picoradar.instrument.errors import BadInput
from picoradar.instrument.settings import Settings

_Device = TypeVar("_Device", bound=Device)


class _UsbWire(Protocol):
    """A wire module with the USB identity of its device."""

    VENDOR_ID: int
    PRODUCT_ID: int


@dataclass(frozen=True)
class Finding:
    """Result of the examination of one device.

    Attributes
    ----------
    name : str
        As in the settings.
    identity : str
        Model, serial number and firmware; empty when it did not answer.
    link : str
        How it is reached.
    problem : str
        What is wrong and what to do; empty when nothing is.
    found_on : tuple of str
        What was on when it was opened, which switched it off.
    """

    name: str
    identity: str
    link: str
    problem: str
    found_on: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Get whether the device can be used as it is."""
        return not self.problem


def examine(settings: Settings, make: DeviceMaker, *, acknowledge: bool = False) -> Iterator[Finding]:
    """Open, identify, check and close each device in turn.

    Parameters
    ----------
    settings : Settings
        What a scan will ask of the devices.
    make : DeviceMaker
    acknowledge : bool
        Clear what a person has to acknowledge once its cause is gone: the lock-out of the bridge's gate, an error of
        the temperature controller.

    Yields
    ------
    Finding
        One per device, as soon as it is known.
    """
    links = make.links
    yield _serial(make, "dg645", links.dg645, links.dg645_baud, make.dg645, checks.generator)
    yield _serial(
        make, "genesys", links.genesys, links.genesys_baud, make.genesys, lambda d: checks.supply(d, settings)
    )
    if links.temperature == "tc200":
        yield _serial(make, "tc200", links.tc200, links.tc200_baud, make.tc200, lambda d: checks.heater(d, settings))
    else:
        yield _serial(
            make,
            "tec",
            links.tec,
            links.tec_baud,
            make.tec,
            lambda d: checks.temperature(d, settings, acknowledge=acknowledge),
        )
    yield _examined("helios", _usb(helios_wire, links.usb_backend), make.helios, checks.galvo)[0]
    yield _examined(
        "bridge",
        _usb(sbp, links.usb_backend),
        make.bridge,
        lambda d: checks.bridge(d, settings, acknowledge=acknowledge),
    )[0]
    if links.sampler == "oscilloscope":
        link = _usb(oscilloscope, links.usb_backend)
        yield _examined("oscilloscope", link, make.oscilloscope, lambda d: checks.oscilloscope(d, settings))[0]


def _usb(wire: _UsbWire, backend: str) -> str:
    """Describe how a USB device is reached."""
    through = f" through {backend}" if backend else ""
    return f"USB {wire.VENDOR_ID:04x}:{wire.PRODUCT_ID:04x}{through}"


def _serial(
    make: DeviceMaker,
    name: str,
    url: str,
    baud: int,
    open_driver: Callable[[], _Device],
    check: Callable[[_Device], Iterator[str]],
) -> Finding:
    """Examine a device on a serial port; when it does not answer, find out what does."""
    finding, error = _examined(name, url, open_driver, check)
    if not isinstance(error, (Timeout, ProtocolError)):
        return finding
    answer = identify_port(url, make.clock, expected=name, baud=baud, genesys_address=make.links.genesys_address)
    if answer is None:
        return finding
    if answer.kind != name:
        found = f"a {answer.kind} answers on this port: links.{name} and links.{answer.kind} seem to be swapped"
    elif answer.baud not in (None, baud):
        found = f"it answers at {answer.baud} baud: set links.{name}_baud = {answer.baud}"
    else:
        return finding
    return Finding(name, finding.identity, url, f"{error.what}; {found}")


def _examined(
    name: str, link: str, open_driver: Callable[[], _Device], check: Callable[[_Device], Iterator[str]]
) -> tuple[Finding, DeviceError | None]:
    """Examine one device, and return what stopped the examination."""
    identity = ""
    found_on: tuple[str, ...] = ()
    problems: list[str] = []
    failure: DeviceError | None = None
    try:
        with _opened(open_driver()) as device:
            found_on = device.found_on
            identity = str(device.identify())
            problems += check(device)
    except BadInput as error:
        problems.append(str(error))
    except DeviceError as error:
        failure = error
        problems.append(f"{error.what}: {error.remedy}" if error.remedy else error.what)
    return Finding(name, identity, link, "; ".join(problems), found_on), failure


@contextmanager
def _opened(device: _Device) -> Iterator[_Device]:
    """Open a device and close it afterwards; of two errors the first one is raised."""
    try:
        device.open()
        yield device
    except DeviceError:
        with suppress(DeviceError):
            device.close()
        raise
    device.close()
