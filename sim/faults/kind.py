"""`Kind`: what a fault does, on which links, with which parameters; and `Site`: where one fault happens."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from picoradar.sim.faults.fault import Fault, Link
from picoradar.sim.faults.when import InjectionSchedule

if TYPE_CHECKING:
    from picoradar.sim.bench import SimulatedBench
    from picoradar.sim.taps import SerialTap, UsbTap


@dataclass(frozen=True)
class Site:
    """Where one fault happens.

    Attributes
    ----------
    bench : SimulatedBench
    fault : Fault
    parameters : mapping
        Of the fault, with the kind's defaults filled in.
    schedule : InjectionSchedule
        Decides at which messages the fault is injected; asked once for each message.
    rng : numpy.random.Generator
    """

    bench: SimulatedBench
    fault: Fault
    parameters: Mapping[str, float]
    schedule: InjectionSchedule
    rng: np.random.Generator

    @property
    def serial(self) -> SerialTap:
        """Get the tap of the serial link that the fault is on."""
        return self.bench.serial_taps[self.fault.link]

    @property
    def usb(self) -> UsbTap:
        """Get the tap of the USB device that the fault is on."""
        return self.bench.usb_taps[self.fault.link]


End = Callable[[], None]


@dataclass(frozen=True)
class Kind:
    """One kind of fault.

    Attributes
    ----------
    links : tuple of str
        Where it can happen.
    meaning : str
        What goes wrong, in a few words.
    install : callable, optional
        ``install(site)`` installs a hook on the messages of its link; the hook asks ``site.schedule`` at each of them.
    begin : callable, optional
        ``begin(site)`` begins a state and returns the function that ends it.
    defaults : dict
        Parameters with their default values.
    """

    links: tuple[Link, ...]
    meaning: str
    install: Callable[[Site], None] | None = None
    begin: Callable[[Site], End] | None = None
    defaults: dict[str, float] = field(default_factory=dict)
