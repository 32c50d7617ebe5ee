"""`reachable_bench`: the devices of the settings as far as they can be made, for what must not fail as a whole."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn, TypeVar, cast

from picoradar.drivers.clock import Clock
from picoradar.drivers.errors import DeviceError, LinkLost
from picoradar.drivers.pulser import Pulser
from picoradar.instrument.bench.bench import Bench
from picoradar.instrument.bench.opening import DeviceMaker
from picoradar.instrument.errors import BadInput
from picoradar.instrument.settings import Links

T = TypeVar("T")


class Missing:
    """Stands for a device that cannot even be made; whatever it is asked, it says why."""

    found_on: tuple[str, ...] = ()

    def __init__(self, name: str, why: str) -> None:
        self._error = LinkLost(name, why, "check the settings")

    def __getattr__(self, verb: str) -> Callable[..., NoReturn]:
        """Get any verb of a device; to call it raises `LinkLost`."""

        def refuse(*_: object, **__: object) -> NoReturn:
            raise self._error

        return refuse

    def close(self) -> None:
        """Nothing is open."""


def reachable_bench(links: Links, clock: Clock) -> Bench:
    """Make the bench's devices; one that cannot be made (no port in the settings, no USB) is `Missing`.

    Parameters
    ----------
    links : Links
    clock : Clock
    """
    make = DeviceMaker(links, clock)
    return Bench(
        clock=clock,
        pulser=Pulser(_made("DG645", make.dg645), _made("Genesys", make.genesys), clock),
        diode=_made("diode", make.diode),
        galvo=_made("galvo", make.helios),
        sampler=_made("sampler", make.sampler),
    )


def _made(name: str, make: Callable[[], T]) -> T:
    try:
        return make()
    except (BadInput, DeviceError) as error:
        return cast("T", Missing(name, str(error)))
