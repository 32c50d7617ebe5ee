"""`reach_temperature`: the diode brought to its temperature, without light."""

from __future__ import annotations

from collections.abc import Callable

from picoradar.drivers.interfaces import TemperatureStatus
from picoradar.instrument.bench import Bench
from picoradar.instrument.controller.requests import Requests
from picoradar.instrument.errors import InterlockTripped
from picoradar.instrument.settings import DiodeSettings

POLL_S = 1.0
NEAR_K = 0.2  # to the target: a controller that has just been given another one may still call itself stable


def reach_temperature(
    bench: Bench,
    settings: DiodeSettings,
    requests: Requests,
    show: Callable[[TemperatureStatus], None] | None = None,
) -> bool:
    """Bring the diode to its temperature and wait until it is stable there.

    Parameters
    ----------
    bench : Bench
    settings : DiodeSettings
    requests : Requests
        Any request to stop ends the wait; the diode is off then.
    show : callable, optional
        Called with each reading, once a second.

    Returns
    -------
    bool
        False when it was stopped.

    Raises
    ------
    InterlockTripped
        When the temperature controller fails, or the diode is not stable in time.
    DeviceError
    """
    diode, limit_s = bench.diode, settings.warm_up_limit_s
    diode.regulate(settings.target_degc)
    end = bench.clock.now() + limit_s
    while True:
        status = diode.status()
        if show is not None:
            show(status)
        if status.problem:
            raise InterlockTripped("diode regulation", f"{status.problem} during warm-up; reset the controller")
        if status.stable and abs(status.temperature_degc - settings.target_degc) < NEAR_K:
            return True
        if bench.clock.now() > end:
            raise InterlockTripped(
                "warm-up", f"{status.temperature_degc:.2f} degC after {limit_s:g} s, not stable; check the heat sink"
            )
        if requests.stop_asked():
            diode.off()
            return False
        bench.clock.sleep(POLL_S)
