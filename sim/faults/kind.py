"""`Kind`: what a fault does, on which links, with which parameters; and the `Site` that it happens at."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

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
        Asked once for each message.
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
    hang : callable, optional
        ``hang(site)`` hangs it into the messages of its link; it asks ``site.schedule`` at each of them.
    begin : callable, optional
        ``begin(site)`` brings a state about and returns what ends it.
    defaults : dict
        Parameters and their values where the fault does not give them.
    """

    links: tuple[Link, ...]
    meaning: str
    hang: Callable[[Site], Any] | None = None
    begin: Callable[[Site], End] | None = None
    defaults: dict[str, float] = field(default_factory=dict)
