"""The interlock opened by hand, without light: both barriers in hardware must see it, and none come back by itself.

Only a person can tell whether the chain works. A torn cable of the INHIBIT input does not inhibit (sheet ``dg645``),
and the ENA terminals of the supply count only with its switch SW1-9 up; it leaves the factory down (``tdk_genesys``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from picoradar.drivers.bridge import SamplingBridge
from picoradar.drivers.clock import Clock
from picoradar.drivers.errors import DeviceError
from picoradar.drivers.genesys import Fault, Genesys
from picoradar.instrument.bench.doctor import Finding
from picoradar.instrument.bench.opening import DeviceMaker

WAIT_S = 60.0  # for a person to walk to the lid
POLL_S = 0.1
SUPPLY_REMEDY = "set its rear switch SW1-9 up, check the wires at the ENA terminals J1-1 and J1-14"
BRIDGE_REMEDY = "check the wires of the interlock input"


def check_interlock(make: DeviceMaker, tell: Callable[[str], None]) -> Iterator[Finding]:
    """Wait until a person has opened the interlock and closed it again; the laser stays off.

    Parameters
    ----------
    make : DeviceMaker
    tell : callable
        Gets what the person is to do.

    Yields
    ------
    Finding
        One for the bridge and one for the supply: whether it saw the chain open and close, and stayed off.
    """
    bridge, supply = make.bridge(), make.genesys()
    try:
        bridge.open()
        supply.open()
        yield from _watched(bridge, supply, make.clock, tell)
    except DeviceError as error:
        yield Finding("interlock", "", "", f"{error.what}: {error.remedy}" if error.remedy else error.what)
    finally:
        for device in (bridge, supply):
            try:
                device.close()
            except DeviceError as error:
                tell(str(error))


def _watched(bridge: SamplingBridge, supply: Genesys, clock: Clock, tell: Callable[[str], None]) -> Iterator[Finding]:
    seen: dict[str, Callable[[], bool]] = {
        "bridge": lambda: not bridge.status().interlock_closed,
        "supply": lambda: Fault.INTERLOCK in supply.fault,
    }
    links = {"bridge": bridge.link.device, "supply": supply.link.device}
    remedies = {"bridge": BRIDGE_REMEDY, "supply": SUPPLY_REMEDY}
    tell(f"open the interlock now (lid, key switch or the button on the wall); {WAIT_S:g} s")
    opened = _wait_for(seen, clock)
    tell("close it again")
    closed = _wait_for({name: _opposite_of(see) for name, see in seen.items() if opened[name]}, clock)
    for name in seen:
        problem = ""
        if not opened[name]:
            problem = f"did not see the interlock open within {WAIT_S:g} s: {remedies[name]}"
        elif not closed[name]:
            problem = f"did not see the interlock close within {WAIT_S:g} s: {remedies[name]}"
        elif name == "supply" and supply.output:
            problem = "its output came back by itself: switch auto-start off (AST 0) before you work with it"
        yield Finding(f"interlock at the {name}", "opened and closed" if not problem else "", links[name], problem)


def _opposite_of(condition: Callable[[], bool]) -> Callable[[], bool]:
    return lambda: not condition()


def _wait_for(conditions: dict[str, Callable[[], bool]], clock: Clock) -> dict[str, bool]:
    """Poll until all hold, or the time is over; returns which did."""
    met = dict.fromkeys(conditions, False)
    end = clock.now() + WAIT_S
    while not all(met.values()) and clock.now() < end:
        for name, condition in conditions.items():
            met[name] = met[name] or condition()
        clock.sleep(POLL_S)
    return met
