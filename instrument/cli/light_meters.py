"""Oscilloscope and power meter at the laser, for the bench procedure `transmitter`."""

from __future__ import annotations

from collections.abc import Callable

from picoradar.drivers.errors import DeviceFault
from picoradar.drivers.interfaces import Record, SweepSettings
from picoradar.drivers.links import Usbtmc
from picoradar.drivers.oscilloscope import Oscilloscope, oscilloscope_link
from picoradar.instrument.bench import named_backend
from picoradar.instrument.cli.person import Person, Wait
from picoradar.instrument.cli.session import Session
from picoradar.instrument.errors import BadInput

DETECTOR_CHANNEL, CURRENT_CHANNEL = 2, 3  # the receiver has the first
FULL_SCALE_V, OFFSET_V = 0.24, 0.05  # of both
R_M_OHM = 0.25  # two resistors of 0.5 ohm in parallel, in the path of the laser's current (section 2.6.1)
ATTENUATION = 50.0  # between R_M and the oscilloscope: 4.9 V become 99 mV
LARGEST_MW = 1000.0  # a larger answer is taken for a typing error

PowerReading = Callable[[str, Wait], float]


class DetectorAndPowerMeter:
    """A fast photodetector at channel 2 of the oscilloscope, and a source of readings of the mean power at the exit.

    At its channel 3, where that is wired, an attenuator of 50 to 1 behind the resistor R_M.
    """

    def __init__(self, scope: Oscilloscope, current_scope: Oscilloscope, power: PowerReading) -> None:
        self._scope = scope
        self._current_scope = current_scope
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

    def current(self, sweep: SweepSettings) -> tuple[Record, float] | None:
        """Take one averaged trace of the laser's current, and its mV for each ampere.

        None when the instrument refuses the channel: it has only two, or nothing is connected.
        """
        self._scope.close()
        try:
            self._current_scope.open()
            self._current_scope.configure(sweep)
            return self._current_scope.take(1)[0], 1e3 * R_M_OHM / ATTENUATION
        except DeviceFault:
            return None
        finally:
            self._current_scope.close()
            self._scope.open()

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
        return DetectorAndPowerMeter(*_scopes(run, backend), lambda _where, _wait: monitor.mean_power_mw())
    if links.sampler == "oscilloscope":
        raise BadInput(
            "bench transmitter needs the oscilloscope for the laser pulse, but here it takes the echoes: "
            'set links.sampler = "bridge"'
        )

    def ask_person(where: str, wait: Wait) -> float:
        question = f"The laser is on, {where}. Mean power at the exit as the power meter shows it, in mW (q: stop):"
        return person.numbers(question, ((0.0, LARGEST_MW),), wait=wait)[0]

    return DetectorAndPowerMeter(*_scopes(run, named_backend(links.usb_backend, links.usb_address)), ask_person)


def _scopes(run: Session, backend: object) -> tuple[Oscilloscope, Oscilloscope]:
    """The one oscilloscope, looked at through the channel of the detector and through that of the current."""
    serial_number = run.settings.links.oscilloscope_serial or None
    tmc = Usbtmc(oscilloscope_link(run.controller.bench.clock, serial_number=serial_number, backend=backend))
    detector, current = (
        Oscilloscope(tmc, channel=channel, full_scale_v=FULL_SCALE_V, offset_v=OFFSET_V)
        for channel in (DETECTOR_CHANNEL, CURRENT_CHANNEL)
    )
    return detector, current
