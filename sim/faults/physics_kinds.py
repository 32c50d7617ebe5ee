"""Faults of mirrors, temperature, supply, triggers, interlock, and the bridge's own clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from picoradar.sim.faults.fault import BENCH
from picoradar.sim.faults.kind import End, Kind, Site
from picoradar.sim.faults.signal_kinds import before


def _clock_unlocked(site: Site) -> End:
    rate = site.parameters["rate"]
    end = before(lambda _site, w: replace(w, delay_ps=w.delay_ps * rate, step_ps=w.step_ps * rate))(site)
    site.bench.bridge.clock_locked = False

    def lock() -> None:
        end()
        site.bench.bridge.clock_locked = True

    return lock


def _mirrors(change: Callable[[float, float], tuple[float, float]], site: Site) -> End:
    servo = site.bench.servo
    servo.change.append(change)

    def free() -> None:
        servo.change.remove(change)
        servo.command(*servo.wanted)

    return free


def _stuck(site: Site) -> End:
    held = site.bench.servo.wanted
    return _mirrors(lambda _x, _y: held, site)


def _limited(site: Site) -> End:
    limit = site.parameters["limit"]
    return _mirrors(lambda x, y: (max(-limit, min(limit, x)), max(-limit, min(limit, y))), site)


def _ringing(site: Site) -> End:
    """Each step sets the mirrors swinging."""
    bench, amplitude, period_s = site.bench, site.parameters["amplitude"], site.parameters["period_s"]
    swinging = [True]

    def swing(since_s: float) -> None:
        if not swinging[0]:
            return
        elapsed_s = bench.clock.now() - since_s
        x, y = bench.servo.wanted
        offset = amplitude * float(np.cos(2 * np.pi * elapsed_s / period_s))
        bench.servo.deflect(max(-1.0, min(1.0, x + offset)), y)
        bench.clock.call_at(bench.clock.now() + period_s / 8, lambda: swing(since_s))

    end = _mirrors(lambda x, y: (x, y), site)
    swing(bench.clock.now())

    def still() -> None:
        swinging[0] = False
        end()

    return still


def _forced_current(site: Site) -> End:
    pump = site.bench.heat_pump
    pump.forced_a = site.parameters["current_a"]
    pump.apply()

    def free() -> None:
        pump.forced_a = None
        pump.apply()

    return free


def _open_sensor(site: Site) -> End:
    site.bench.heat_pump.sensor_degc = site.parameters["reads_degc"]

    def repair() -> None:
        site.bench.heat_pump.sensor_degc = None

    return repair


def _regulation_stops(site: Site) -> End:
    site.bench.tec.device.trip(int(site.parameters["error"]))
    return lambda: None


def _interlock(site: Site) -> End:
    chain = site.bench.interlock
    chain.closed = False

    def close() -> None:
        chain.closed = True

    return close


def _sag(site: Site) -> End:
    supply = site.bench.genesys.supply
    before = supply.settings.current_text
    supply.change(current_text=f"{site.parameters['current_a']:.3f}")
    return lambda: supply.change(current_text=before)


def _supply_off(site: Site) -> End:
    site.bench.genesys.supply.switch(on=False)
    return lambda: None


def _rate(site: Site) -> End:
    line, factor = site.bench.trigger, site.parameters["factor"]
    before = line.rate_hz
    line.rate_hz = before * factor

    def repair() -> None:
        line.rate_hz = before

    return repair


PHYSICS_KINDS: dict[str, Kind] = {
    "interlock_opened": Kind(BENCH, "lid, key switch or a monitor opens the interlock chain", begin=_interlock),
    "bridge_clock": Kind(BENCH, "the delay clock is not locked", begin=_clock_unlocked, defaults={"rate": 1.02}),
    "mirror_stuck": Kind(BENCH, "the mirrors stay where they are", begin=_stuck),
    "mirror_limited": Kind(BENCH, "the mirrors do not reach their place", begin=_limited, defaults={"limit": 0.02}),
    "mirror_ringing": Kind(
        BENCH, "the mirrors swing", begin=_ringing, defaults={"amplitude": 0.05, "period_s": 0.02}
    ),
    "diode_disturbed": Kind(BENCH, "the diode is warmed", begin=_forced_current, defaults={"current_a": 1.6}),
    "tec_runaway": Kind(BENCH, "the Peltier element only heats", begin=_forced_current, defaults={"current_a": 4.0}),
    "tec_sensor_open": Kind(
        BENCH, "the temperature sensor is broken", begin=_open_sensor, defaults={"reads_degc": -60.0}
    ),
    "tec_stopped": Kind(BENCH, "the temperature controller trips", begin=_regulation_stops, defaults={"error": 105.0}),
    "supply_sag": Kind(BENCH, "the drive voltage breaks down", begin=_sag, defaults={"current_a": 0.011}),
    "supply_off": Kind(BENCH, "the drive supply switches off by itself", begin=_supply_off),
    "triggers_lost": Kind(BENCH, "the trigger cable has no contact", begin=_rate, defaults={"factor": 0.0}),
    "rate_drift": Kind(BENCH, "the trigger rate drifts", begin=_rate, defaults={"factor": 1.03}),
}  # fmt: skip
