"""Oscilloscope and power meter at the laser, for the bench procedure `transmitter`."""

from __future__ import annotations

from collections.abc import Callable

from picoradar.drivers.interfaces import Record, SweepSettings
from picoradar.drivers.links import Usbtmc
from picoradar.drivers.oscilloscope import Oscilloscope, oscilloscope_link
from picoradar.instrument.bench import named_backend
from picoradar.instrument.cli.person import Person, Wait
from picoradar.instrument.cli.session import Session
from picoradar.instrument.errors import BadInput

DETECTOR_CHANNEL = 2  # the receiver has the first
FULL_SCALE_V, OFFSET_V = 0.24, 0.05
LARGEST_MW = 1000.0  # a larger answer is taken for a typing error

PowerReading = Callable[[str, Wait], float]


class DetectorAndPowerMeter:
    """A fast photodetector at channel 2 of the oscilloscope, and a source of readings of the mean power at the exit."""

    def __init__(self, scope: Oscilloscope, power: PowerReading) -> None:
        self._scope = scope
        self._power = power

    def open(self) -> None:
        """Open the oscilloscope."""
        self._scope.open()

    def close(self) -> None:
        """Close the oscilloscope."""
        self._scope.close()

    def trace(self, sweep: SweepSettings) -> Record:
        """Take one averaged trace of the laser pulse."""
        self._scope.configure(sweep)
        return self._scope.take(1)[0]

    def mean_power_mw(self, where: str, wait: Wait) -> float:
        """Read the power meter; ``where`` names the operating point, ``wait`` lets time pass with the laser on."""
        return self._power(where, wait)


def light_meters(run: Session, person: Person) -> DetectorAndPowerMeter:
    """Make the meters of a bench: the simulated one has a power meter, otherwise the person reads one.

    Parameters
    ----------
    run : Session
        The open bench.
    person : Person
        Who reads the power meter of real devices.

    Raises
    ------
    BadInput
        When the oscilloscope is in use for something else.
    """
    links = run.settings.links
    if run.simulated is not None:
        backend, monitor = run.simulated.usb_backend, run.simulated.bench.monitor
        return DetectorAndPowerMeter(_scope(run, backend), lambda _where, _wait: monitor.mean_power_mw())
    if links.sampler == "oscilloscope":
        raise BadInput(
            "bench transmitter needs the oscilloscope for the laser pulse, but here it takes the echoes: "
            'set links.sampler = "bridge"'
        )

    def ask_person(where: str, wait: Wait) -> float:
        question = f"The laser is on, {where}. Mean power at the exit as the power meter shows it, in mW (q: stop):"
        return person.numbers(question, ((0.0, LARGEST_MW),), wait=wait)[0]

    return DetectorAndPowerMeter(_scope(run, named_backend(links.usb_backend, links.usb_address)), ask_person)


def _scope(run: Session, backend: object) -> Oscilloscope:
    serial_number = run.settings.links.oscilloscope_serial or None
    link = oscilloscope_link(run.controller.bench.clock, serial_number=serial_number, backend=backend)
    return Oscilloscope(Usbtmc(link), channel=DETECTOR_CHANNEL, full_scale_v=FULL_SCALE_V, offset_v=OFFSET_V)
