"""Injects declared faults into a simulated bench."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, TypeVar

from picoradar.sim.faults.fault import SERIAL, Fault
from picoradar.sim.faults.kind import Kind, Site
from picoradar.sim.faults.kinds import KINDS
from picoradar.sim.faults.when import InjectionSchedule

if TYPE_CHECKING:
    from picoradar.sim.bench import SimulatedBench


_Message = TypeVar("_Message")


def arm(bench: SimulatedBench, faults: Iterable[Fault]) -> Sequence[InjectionSchedule]:
    """Inject faults into a bench.

    Parameters
    ----------
    bench : SimulatedBench
    faults : iterable of Fault
        Checked against `KINDS` (`picoradar.sim.faults.scenario.checked`).

    Returns
    -------
    sequence of InjectionSchedule
        One for each fault; its ``first_s`` is when the fault was first injected.

    Raises
    ------
    ValueError
        When a fault is on a device that this bench does not have.
    """
    return [_arm_one(bench, number, fault) for number, fault in enumerate(faults)]


def _arm_one(bench: SimulatedBench, number: int, fault: Fault) -> InjectionSchedule:
    kind = KINDS[fault.kind]
    if fault.link in SERIAL and fault.link not in bench.serial_taps:
        raise ValueError(
            f"fault {number + 1}: {fault.link} is not on this bench, which has {', '.join(bench.serial_taps)}"
        )
    rng = bench.noise.stream("faults", number)
    schedule = InjectionSchedule(fault, bench.clock, lambda: bench.signal.shots, rng)
    site = Site(bench, fault, {**kind.defaults, **fault.parameters}, schedule, rng)
    if kind.install is not None:
        kind.install(site)
    else:
        _await(site, kind)
    return schedule


def _await(site: Site, kind: Kind) -> None:
    """Arrange that a state begins once, when it is due: by a timer, or at a message or a window on its link."""
    at, clock = site.fault.at, site.bench.clock
    begun = False

    def inject() -> None:
        nonlocal begun
        if begun or kind.begin is None or not site.schedule.hits():
            return
        begun = True
        end = kind.begin(site)
        if site.fault.lasts_s is not None:
            clock.call_at(clock.now() + site.fault.lasts_s, end)

    if at.time_s is not None:
        clock.call_at(max(at.time_s, clock.now()), inject)
    elif at.pulse is not None or site.fault.link == "bench":
        site.bench.signal.before.append(lambda wanted: _first(inject, wanted))
    elif site.fault.link in SERIAL:
        site.serial.to_device.append(lambda data: _first(inject, data))
    else:
        site.usb.before.append(lambda _setup: inject())


def _first(inject: Callable[[], None], message: _Message) -> _Message:
    """Let a state begin at a message, and pass the message on."""
    inject()
    return message
