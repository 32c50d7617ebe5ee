"""From settings to a bench: the driver of each device, with its link.

A device of another manufacturer is one new folder in ``drivers`` and one method here.
"""

from __future__ import annotations

import importlib

from picoradar.drivers.bridge import SamplingBridge, bridge_link
from picoradar.drivers.clock import Clock
from picoradar.drivers.dg645 import DG645
from picoradar.drivers.errors import LinkLost
from picoradar.drivers.genesys import Genesys
from picoradar.drivers.helios import Helios, helios_link
from picoradar.drivers.interfaces import Sampler, TemperatureController
from picoradar.drivers.links import SerialLink, Transcript, Usbtmc
from picoradar.drivers.mecom import Tec
from picoradar.drivers.oscilloscope import Oscilloscope, oscilloscope_link
from picoradar.drivers.pulser import Pulser
from picoradar.drivers.tc200 import TC200
from picoradar.instrument.bench.bench import Bench
from picoradar.instrument.errors import BadInput
from picoradar.instrument.settings import USB_BACKENDS, Links


class DeviceMaker:
    """Makes the devices that the settings name; opens nothing.

    Parameters
    ----------
    links : Links
        Where the devices are.
    clock : Clock
        Time for all of them.
    usb_backend : object, optional
        A pyusb backend; without it the one that the settings name, or libusb.
    transcript : Transcript, optional
        Records every byte in both directions.

    Raises
    ------
    BadInput
        By each method, when a port is missing in the settings or the backend cannot be made.
    LinkLost
        By the methods of the USB devices, when the backend cannot be reached.
    """

    def __init__(
        self, links: Links, clock: Clock, usb_backend: object | None = None, transcript: Transcript | None = None
    ) -> None:
        self.links = links
        self.clock = clock
        self._usb_backend = usb_backend
        self._transcript = transcript

    def dg645(self) -> DG645:
        """Make the delay generator."""
        return DG645(self._serial("dg645", "DG645", self.links.dg645, self.links.dg645_baud))

    def genesys(self) -> Genesys:
        """Make the drive supply."""
        link = self._serial("genesys", "Genesys", self.links.genesys, self.links.genesys_baud, timeout_s=0.5)
        return Genesys(link, address=self.links.genesys_address)

    def tec(self) -> Tec:
        """Make the temperature controller of Meerstetter."""
        return Tec(self._serial("tec", "TEC", self.links.tec, self.links.tec_baud), address=self.links.tec_address)

    def tc200(self) -> TC200:
        """Make the temperature controller of Thorlabs."""
        return TC200(self._serial("tc200", "TC200", self.links.tc200, self.links.tc200_baud))

    def diode(self) -> TemperatureController:
        """Make the temperature controller that the settings choose."""
        return self.tc200() if self.links.temperature == "tc200" else self.tec()

    def helios(self) -> Helios:
        """Make the galvo controller."""
        link = helios_link(self.clock, backend=self._backend())
        link.transcript = self._transcript
        return Helios(link)

    def bridge(self) -> SamplingBridge:
        """Make the sampling bridge."""
        link = bridge_link(self.clock, serial_number=self.links.bridge_serial or None, backend=self._backend())
        link.transcript = self._transcript
        return SamplingBridge(link)

    def oscilloscope(self) -> Oscilloscope:
        """Make the sampling oscilloscope; the gate in the trigger line stays with the bridge."""
        serial_number = self.links.oscilloscope_serial or None
        link = oscilloscope_link(self.clock, serial_number=serial_number, backend=self._backend())
        link.transcript = self._transcript
        return Oscilloscope(Usbtmc(link), gate=self.bridge())

    def sampler(self) -> Sampler:
        """Make the sampler that the settings choose."""
        return self.oscilloscope() if self.links.sampler == "oscilloscope" else self.bridge()

    def _serial(self, key: str, device: str, url: str, baud: int, *, timeout_s: float = 1.0) -> SerialLink:
        if not url:
            raise BadInput(f"settings: links.{key} is empty; give the port or URL of that device")
        link = SerialLink(url, self.clock, device=device, baud=baud, timeout_s=timeout_s)
        link.transcript = self._transcript
        return link

    def _backend(self) -> object | None:
        if self._usb_backend is None:
            self._usb_backend = named_backend(self.links.usb_backend, self.links.usb_address)
        return self._usb_backend


def make_bench(
    links: Links, clock: Clock, usb_backend: object | None = None, transcript: Transcript | None = None
) -> Bench:
    """Make the bench's devices; nothing is opened yet.

    Parameters
    ----------
    links, clock, usb_backend, transcript
        As for `DeviceMaker`.

    Raises
    ------
    BadInput
        When a port is missing in the settings or the backend cannot be made.
    LinkLost
        When the USB backend cannot be reached.
    """
    make = DeviceMaker(links, clock, usb_backend, transcript)
    return Bench(
        clock=clock,
        pulser=Pulser(make.dg645(), make.genesys(), clock),
        diode=make.diode(),
        galvo=make.helios(),
        sampler=make.sampler(),
    )


def named_backend(name: str, address: str) -> object | None:
    """Make the pyusb backend ``module:function`` with its address; None (libusb) for an empty name.

    Parameters
    ----------
    name : str
        ``module:function``, one of `USB_BACKENDS`; empty for libusb.
    address : str
        ``host:port``, the argument of that function.

    Raises
    ------
    BadInput
        When the name is none of `USB_BACKENDS`, or the address is not host:port.
    LinkLost
        When nothing answers at the address.
    """
    if not name:
        return None
    if name not in USB_BACKENDS:
        raise BadInput(
            f"settings: links.usb_backend {name!r}: not a backend of picoradar; give {' or '.join(USB_BACKENDS)}, "
            "or leave it empty for libusb"
        )
    module, _, function = name.partition(":")
    try:
        backend: object = getattr(importlib.import_module(module), function)(address)
    except OSError as error:
        remedy = "start picoradar sim again, and use the settings file that it names"
        raise LinkLost(f"USB backend ({name})", f"cannot reach {address!r}: {error}", remedy) from error
    except ValueError as error:
        raise BadInput(f"settings: links.usb_address {address!r}: {error}; give host:port") from error
    return backend
