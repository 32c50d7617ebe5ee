"""`RunContext`: what a run works with; and the working point that it waits for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from picoradar.drivers.interfaces import Identity
from picoradar.instrument.bench import Bench
from picoradar.instrument.controller.machine import StateMachine
from picoradar.instrument.controller.requests import Requests
from picoradar.instrument.controller.safety import SafeShutdown
from picoradar.instrument.controller.supervision import Supervisor
from picoradar.instrument.events import Log
from picoradar.instrument.settings import Settings

POLL_S = 0.2
SETTLED_FOR_S = 2.0  # the heat of the light takes a moment to show at the diode's sensor


@dataclass
class RunContext:
    """What a scan works with; owned by the controller."""

    bench: Bench
    settings: Settings
    machine: StateMachine
    supervisor: Supervisor
    requests: Requests
    known: Mapping[str, Identity]
    shutdown: SafeShutdown
    log: Log


def reach_working_point(context: RunContext, between: Callable[[], None]) -> bool:
    """Wait until the diode, warmed by its own light, is where every line of every scan finds it.

    Parameters
    ----------
    context : RunContext
    between : callable
        Called before each poll; may raise.

    Returns
    -------
    bool
        False when the limit of the settings has passed before; the interlocks still hold then.
    """
    clock, diode = context.bench.clock, context.settings.diode
    end = clock.now() + diode.settle_limit_s
    inside_since_s = clock.now()
    while clock.now() - inside_since_s < SETTLED_FOR_S:
        if clock.now() >= end:
            context.log.warning("working point not reached", limit_s=diode.settle_limit_s)
            return False
        between()
        if abs(context.bench.diode.status().temperature_degc - diode.target_degc) > diode.settled_k:
            inside_since_s = clock.now()
        clock.sleep(POLL_S)
    return True
