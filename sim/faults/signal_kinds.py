"""Faults of the light and of its digitisation by the bridge."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.faults.fault import BENCH
from picoradar.sim.faults.kind import End, Kind, Site
from picoradar.sim.wires import Acquisition

Sums = NDArray[np.uint32]
REFERENCE_ENDS_PS = 8300.0  # the reference crosses 50 % at about 7.3 ns, an echo from 620 mm at about 8.6 ns
FULL_CODE = 255


def _after(corrupt: Callable[[Site, Sums, Acquisition], Sums]) -> Callable[[Site], End]:
    """Change the sums of every window while the fault lasts."""

    def begin(site: Site) -> End:
        def hook(sums: Sums, wanted: Acquisition) -> Sums:
            return corrupt(site, sums, wanted)

        site.bench.signal.after.append(hook)
        return lambda: site.bench.signal.after.remove(hook)

    return begin


def before(change: Callable[[Site, Acquisition], Acquisition]) -> Callable[[Site], End]:
    """Change the settings of every window while the fault lasts."""

    def begin(site: Site) -> End:
        def hook(wanted: Acquisition) -> Acquisition:
            return change(site, wanted)

        site.bench.signal.before.append(hook)
        return lambda: site.bench.signal.before.remove(hook)

    return begin


def _zero(site: Site, wanted: Acquisition) -> float:
    return site.bench.settings.code_of_zero * wanted.sweeps


def _times_ps(wanted: Acquisition) -> NDArray[np.float64]:
    return np.asarray(wanted.delay_ps + wanted.step_ps * np.arange(wanted.samples))


def _codes(values: NDArray[np.floating], wanted: Acquisition) -> Sums:
    codes: Sums = np.clip(np.rint(values), 0, FULL_CODE * wanted.sweeps).astype(np.uint32)
    return codes


def _blanked(site: Site, sums: Sums, wanted: Acquisition, where: NDArray[np.bool_]) -> Sums:
    """Put noise in place of a pulse."""
    noise = site.rng.normal(_zero(site, wanted), np.sqrt(wanted.sweeps), wanted.samples)
    blanked: Sums = np.where(where, _codes(noise, wanted), sums)
    return blanked


def _no_reference(site: Site, sums: Sums, wanted: Acquisition) -> Sums:
    return _blanked(site, sums, wanted, _times_ps(wanted) < REFERENCE_ENDS_PS)


def _no_return(site: Site, sums: Sums, wanted: Acquisition) -> Sums:
    return _blanked(site, sums, wanted, _times_ps(wanted) >= REFERENCE_ENDS_PS)


def _double_return(site: Site, sums: Sums, wanted: Acquisition) -> Sums:
    zero = _zero(site, wanted)
    later = max(1, round(site.parameters["delay_ps"] / wanted.step_ps))
    light = np.where(_times_ps(wanted) >= REFERENCE_ENDS_PS, sums - zero, 0.0)
    second = np.concatenate([np.zeros(later), light[:-later]]) * site.parameters["share"]
    return _codes(sums + second, wanted)


def _weak(site: Site, sums: Sums, wanted: Acquisition) -> Sums:
    zero = _zero(site, wanted)
    return _codes(zero + (sums - zero) * site.parameters["share"], wanted)


def _noisy(site: Site, sums: Sums, wanted: Acquisition) -> Sums:
    return _codes(sums + site.rng.normal(0, site.parameters["codes"] * np.sqrt(wanted.sweeps), len(sums)), wanted)


def _jitter(site: Site, sums: Sums, wanted: Acquisition) -> Sums:
    """Shots that come at random times blur the averaged trace."""
    sigma = site.parameters["sigma_ps"] / wanted.step_ps
    reach = int(4 * sigma) + 1
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    padded = np.pad(sums.astype(np.float64), reach, mode="edge")
    return _codes(np.convolve(padded, kernel / kernel.sum(), mode="valid"), wanted)


def _saturated(_site: Site, sums: Sums, wanted: Acquisition) -> Sums:
    return np.full_like(sums, FULL_CODE * wanted.sweeps)


def _misfire(site: Site, wanted: Acquisition) -> Acquisition:
    missed = bool(site.rng.random() < site.parameters["share"])
    return site.bench.signal.dark(wanted) if missed else wanted


SIGNAL_KINDS: dict[str, Kind] = {
    "misfire": Kind(BENCH, "the laser does not fire in some records", begin=before(_misfire), defaults={"share": 0.5}),
    "laser_dark": Kind(BENCH, "the laser gives no light", begin=before(lambda s, w: s.bench.signal.dark(w))),
    "laser_weak": Kind(BENCH, "the laser loses power", begin=_after(_weak), defaults={"share": 0.15}),
    "reference_lost": Kind(BENCH, "the reference fibre gives no light", begin=_after(_no_reference)),
    "no_return": Kind(BENCH, "no echo comes back", begin=_after(_no_return)),
    "double_return": Kind(
        BENCH, "a second echo, as from a specular surface", begin=_after(_double_return),
        defaults={"delay_ps": 900.0, "share": 0.6},
    ),
    "adc_saturated": Kind(BENCH, "every sample is at the end of the A/D", begin=_after(_saturated)),
    "adc_noise": Kind(BENCH, "noise on the A/D", begin=_after(_noisy), defaults={"codes": 25.0}),
    "trigger_jitter": Kind(BENCH, "shots come at random times", begin=_after(_jitter), defaults={"sigma_ps": 120.0}),
}  # fmt: skip
