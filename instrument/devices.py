"""From settings to a bench: each device opened by the driver of its kind.

Another maker's device is one new driver module and one line here.
"""

from __future__ import annotations

import importlib
from typing import Any

from drivers.clock import Clock
from drivers.dg645 import DG645
from drivers.genesys import Genesys
from drivers.helios import Helios, helios_link
from drivers.mecom import Tec
from drivers.pulser import Pulser
from drivers.sampling_bridge import SamplingBridge, bridge_link
from drivers.serial_link import SerialLink
from instrument.bench import Bench
from instrument.errors import BadInput
from instrument.settings import Links


def make_bench(links: Links, clock: Clock, usb_backend: Any = None) -> Bench:
    """Make the bench's devices; nothing is opened yet.

    Parameters
    ----------
    links : Links
        Where the devices are.
    clock : Clock
        Time for all of them.
    usb_backend : object, optional
        A pyusb backend; without it the one that the settings name, or libusb.

    Raises
    ------
    BadInput
        When a port is missing in the settings or the backend cannot be made.
    """
    for name in ("dg645", "genesys", "tec"):
        if not getattr(links, name):
            raise BadInput(f"settings: links.{name} is empty; give the port or URL of that device")
    backend = usb_backend if usb_backend is not None else named_backend(links.usb_backend, links.usb_address)
    dg645 = DG645(SerialLink(links.dg645, clock, device="DG645", baud=links.dg645_baud))
    genesys = Genesys(
        SerialLink(links.genesys, clock, device="Genesys", baud=links.genesys_baud, timeout_s=0.5),
        address=links.genesys_address,
    )
    tec = Tec(SerialLink(links.tec, clock, device="TEC", baud=links.tec_baud), address=links.tec_address)
    return Bench(
        clock=clock,
        pulser=Pulser(dg645, genesys, clock),
        diode=tec,
        galvo=Helios(helios_link(clock, backend=backend)),
        sampler=SamplingBridge(bridge_link(clock, serial_number=links.bridge_serial or None, backend=backend)),
    )


def named_backend(name: str, address: str) -> Any:
    """Make the pyusb backend ``module:function`` with its address; None (libusb) for an empty name.

    Raises
    ------
    BadInput
        When the name is not of that form or cannot be imported.
    """
    if not name:
        return None
    module, _, function = name.partition(":")
    try:
        return getattr(importlib.import_module(module), function)(address)
    except (ImportError, AttributeError, ValueError) as error:
        raise BadInput(
            f"settings: links.usb_backend {name!r}: {error}; give module:function, or leave it empty"
        ) from error
