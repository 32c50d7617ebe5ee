"""The doctor's checks of each device after opening it: faults, and whether it can do what the settings ask for.

Each check yields one line per problem: what it is, then what to do.
"""

from __future__ import annotations

from collections.abc import Iterator

from picoradar.drivers.bridge import SamplingBridge
from picoradar.drivers.dg645 import DG645, InstrumentStatus
from picoradar.drivers.errors import LimitError
from picoradar.drivers.genesys import Fault, Genesys
from picoradar.drivers.helios import Helios
from picoradar.drivers.interfaces import Sampler, SweepSettings
from picoradar.drivers.mecom import Tec
from picoradar.drivers.oscilloscope import Oscilloscope
from picoradar.drivers.tc200 import TC200, Mode
from picoradar.instrument.settings import Settings

SUPPLY_FAULTS = {
    Fault.AC_FAIL: "mains failure: check the mains",
    Fault.OVER_TEMPERATURE: "too hot: let it cool, free its air inlets",
    Fault.FOLDBACK: "the current limit has shut it down: check the pulser's load",
    Fault.OVER_VOLTAGE: "over-voltage has tripped: find the cause, switch the supply off and on",
    Fault.SHUT_OFF: "shut off at its rear connector: close the shut-off contact",
    Fault.PANEL_OFF: "switched off at its front panel: press OUT there",
    Fault.INTERLOCK: "interlock open at the ENA terminals: close lid and key switch",
}


def generator(device: DG645) -> Iterator[str]:
    """Check the delay generator."""
    if code := device.self_test():
        yield f"self test gives error {code}: have it serviced"
    status = device.instrument_status()
    if status & InstrumentStatus.INHIBITED:
        yield "triggers are inhibited at its rear input: close lid and key switch"
    if status & (InstrumentStatus.PLL_UNLOCKED | InstrumentStatus.RUBIDIUM_UNLOCKED):
        yield "time base is not locked: let it warm up, check the external reference"


def supply(device: Genesys, settings: Settings) -> Iterator[str]:
    """Check the drive supply."""
    fault = device.fault
    yield from (text for bit, text in SUPPLY_FAULTS.items() if fault & bit)
    if settings.pulser.drive_v > device.rated_v:
        wanted_v = settings.pulser.drive_v
        yield f"rated for {device.rated_v:g} V, the settings ask for {wanted_v:g} V: lower pulser.drive_v"


def temperature(device: Tec, settings: Settings, *, acknowledge: bool) -> Iterator[str]:
    """Check the temperature controller."""
    if acknowledge and device.error_number:
        device.reset()
    status = device.status()
    if status.problem:
        yield f"{status.problem}: find the cause, then picoradar doctor --acknowledge resets it"
    target = settings.diode.target_degc
    minimum, maximum = device.lower_threshold_degc, device.upper_threshold_degc
    if not minimum < target < maximum:
        yield f"its error thresholds are {minimum:g} to {maximum:g} degC, the target is {target:g} degC: set them wider"
    if device.current_limit_a <= 0:
        yield "its current limit is 0 A, so it cannot regulate: set the limit of your Peltier element"


def heater(device: TC200, settings: Settings) -> Iterator[str]:
    """Check the temperature controller TC200, which can only heat."""
    target, largest = settings.diode.target_degc, device.largest_degc
    if target > largest:
        yield f"its largest temperature is {largest:g} degC, the target is {target:g} degC: set its tmax higher"
    if device.mode is not Mode.NORMAL:
        yield "it is in cycle mode: set it to normal mode"
    ambient = device.temperature_degc
    if ambient > target:
        yield f"the diode is at {ambient:.1f} degC, the target is {target:g} degC: it can only heat; cool the room"


def galvo(device: Helios) -> Iterator[str]:
    """Check the galvo controller."""
    if not device.ready():
        yield "its buffers stay full: switch it off and on"


def bridge(device: SamplingBridge, settings: Settings, *, acknowledge: bool) -> Iterator[str]:
    """Check the sampling bridge."""
    if acknowledge and device.status().interlock_closed:
        device.clear_lockout()
    status = device.status()
    if not status.interlock_closed:
        yield "interlock open: close lid and key switch"
    if status.gate == "locked":
        yield "gate is locked since its watchdog or the interlock tripped: picoradar doctor --acknowledge unlocks it"
    elif status.problem:
        yield f"{status.problem}: run the doctor again; if it comes back, see docs/devices.md"
    yield from _sampling(device, settings)


def oscilloscope(device: Oscilloscope, settings: Settings) -> Iterator[str]:
    """Check the oscilloscope that takes the traces in the bridge's place."""
    if problem := device.status().problem:
        yield f"{problem}: run the doctor again; if it comes back, see docs/devices.md"
    yield from _sampling(device, settings)


def _sampling(device: Sampler, settings: Settings) -> Iterator[str]:
    """Check whether the device can sample as the settings ask."""
    sampler = settings.sampler
    try:
        device.configure(
            SweepSettings(
                start_ps=sampler.start_ps,
                step_ps=sampler.step_ps,
                samples=sampler.samples,
                averages=settings.scan.averages,
                settle_shots=sampler.settle_shots,
                prf_hz=settings.pulser.prf_hz,
            )
        )
    except LimitError as error:
        yield f"cannot sample as the settings ask: {error.what}"
