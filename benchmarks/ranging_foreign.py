"""Waveforms of other instruments, in bins of 1 ns with a known truth: does the ranging do with settings only?

    python benchmarks/ranging_foreign.py [--seed 5] [--records 400] [--only NAME] [--method half-maximum]

Two kinds of sets. "simulated" are traces of the simulated radar, in both of its worlds, slowed down until their pulses
are some nanoseconds wide, and put through an integrating digitiser. "airborne" are drawn: asymmetric pulses of
responses between a few counts and full scale, slopes that broaden them, further returns, tails that ring. A row has
the share of records with a range, the robust deviation of the interval, records off by more than 0.6 ns (and those of
them without a flag that casts doubt), and the share of flagged ones.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import METHODS
from picoradar.instrument.line import SUSPECT, Flag
from picoradar.instrument.ranging import LearningSettings, OtherPulse, Ranges, RangingSettings, estimate
from picoradar.sim.physics import LIGHT_MM_PER_PS
from picoradar.sim.validation import TIMES_PS, painted

FloatArray = NDArray[np.float64]

BIN_PS = 1000.0
OWN_FWHM_PS = 600.0  # of the simulated receiver (section 2.5)
FAR_NS = 0.6  # beyond it a range is wrong
DOUBT = np.uint16(SUSPECT & ~Flag.WALK_EXTRAPOLATED)
TO_HALF = np.sqrt(2 * np.log(2))  # standard deviations of a Gaussian from its peak to half of it


@dataclass(frozen=True)
class Digitiser:
    """An integrating digitiser: each sample is the mean of the signal over its bin.

    Attributes
    ----------
    bits : int
    offset, noise : float
        Counts at rest, and standard deviation of the noise (counts).
    code : float
        What a count is written as: 1, or so many volts.
    """

    bits: int = 12
    offset: float = 200.0
    noise: float = 1.5
    code: float = 1.0

    @property
    def full_scale(self) -> tuple[float, float]:
        """Get its ends, in the unit of its samples."""
        return 0.0, (2**self.bits - 1) * self.code

    def read(self, counts: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return the samples of a signal above its rest (..., S)."""
        noisy = counts + self.offset + rng.normal(0, self.noise, counts.shape)
        return np.clip(np.round(noisy), 0, 2**self.bits - 1) * self.code


class Set(NamedTuple):
    """Records (R, S), their instants (S,), true intervals (R,) but for a constant, and, where the time zero is not in
    the traces, its instants (R,); all in ps."""

    traces: FloatArray
    times_ps: FloatArray
    true_ps: FloatArray
    zero_ps: FloatArray | None = None


class Score(NamedTuple):
    """Share ranged, robust deviation (ns), records off by more than 0.6 ns, those unflagged, and share flagged."""

    ranged: float
    sd_ns: float
    far: int
    unflagged: int
    flagged: float

    @classmethod
    def of(cls, found: Ranges, true_ps: FloatArray) -> Score:
        """Compare ranges with true intervals (R,); the constant between the two is the median."""
        off = (found.echo_ps - found.reference_ps - true_ps) / 1000
        there, flagged = np.isfinite(off), (found.flags & DOUBT) != 0
        if not there.any():
            return cls(0.0, float("nan"), 0, 0, float(flagged.mean()))
        off -= np.median(off[there])
        far = there & (np.abs(off) > FAR_NS)
        sd = 1.4826 * float(np.median(np.abs(off[there])))
        return cls(float(there.mean()), sd, int(far.sum()), int((far & ~flagged).sum()), float(flagged.mean()))


def binned(times_ps: FloatArray, traces: FloatArray, starts_ps: FloatArray, bins: int) -> FloatArray:
    """Return means (R, bins) of traces (R, S) over bins of 1 ns that begin at each record's start."""
    step = times_ps[1] - times_ps[0]
    sums = np.concatenate([np.zeros((len(traces), 1)), np.cumsum(traces, axis=1)], axis=1) * step
    edges = starts_ps[:, None] + BIN_PS * np.arange(bins + 1)
    ends = np.concatenate([times_ps - step / 2, times_ps[-1:] + step / 2])
    whole = [np.interp(at, ends, total) for at, total in zip(edges, sums, strict=True)]
    return np.diff(np.array(whole), axis=1) / BIN_PS


@lru_cache(maxsize=8)
def radar(world: str, records: int, seed: int, second_mm: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return traces (R, S) mV of plates at 70 cm to 1.1 m, 20 to 60 mV, and true intervals (R,) in ps; with a second
    echo at a distance of 40 % of the first."""
    rng = np.random.default_rng(seed)
    traces, true = [], []
    plates = 10
    for k in range(plates):
        changes = {"second_path_share": 0.4, "second_path_mm": second_mm} if second_mm else {}
        where = {"target": "plate", "distance_mm": rng.uniform(720.0, 1050.0), "world": world}
        bench = painted(seed + k, rng.uniform(20.0, 60.0), **where, **changes)
        for _ in range(records // plates):
            trace, truth = bench.take(sweeps=16)
            traces.append(trace)
            true.append(2 * truth.range_mm / LIGHT_MM_PER_PS)
    return np.array(traces), np.array(true)


def simulated(
    world: str,
    fwhm_ps: float,
    digitiser: Digitiser,
    records: int,
    seed: int,
    *,
    gain: float = 5.0,
    second_mm: float = 0,
) -> Set:
    """Slow traces of the simulated radar down to a width, and digitise them with a gain (counts per mV)."""
    rng = np.random.default_rng(seed)
    slower = fwhm_ps / OWN_FWHM_PS
    traces, true = radar(world, records, seed, second_mm)
    times = slower * (TIMES_PS - TIMES_PS[0])
    bins = int((times[-1] - times[0]) / BIN_PS) - 2
    values = binned(times, traces, rng.uniform(0, BIN_PS, len(traces)), bins)
    return Set(digitiser.read(gain * values, rng), BIN_PS * np.arange(bins), slower * true)


class Forest(NamedTuple):
    """What the drawn waveforms are like: width (ns), skew (fall over rise), share of broadened and of further returns,
    responses (counts), size of the ringing behind a pulse, and length of a trace (ns)."""

    fwhm_ns: float = 5.0
    skew: float = 1.25
    broadened: float = 0.3
    further: float = 0.3
    lowest: float = 10.0
    highest: float = 300.0
    ringing: float = 0.0
    length_ns: int = 130


def pulse(after_ns: FloatArray, fwhm_ns: float, skew: float, ringing: float) -> FloatArray:
    """Return a pulse of unit peak at 0, whose fall is slower than its rise, and which rings behind."""
    sd = fwhm_ns / TO_HALF / (1 + skew)
    body = np.exp(-0.5 * (after_ns / np.where(after_ns < 0, sd, skew * sd)) ** 2)
    late = np.maximum(after_ns - 1.5 * fwhm_ns, 0.0) / fwhm_ns
    return np.asarray(body + ringing * np.sin(2 * np.pi * late / 1.3) * np.exp(-late), dtype=np.float64)


def airborne(forest: Forest, digitiser: Digitiser, records: int, seed: int, *, joined: bool = True) -> Set:
    """Draw an outgoing pulse and the returns of each record; not joined, the outgoing pulse is known, not seen."""
    rng = np.random.default_rng(seed)
    fine = 0.05
    times = fine * np.arange(int(forest.length_ns / fine))
    width, rise = forest.fwhm_ns, 1 / (1 + forest.skew)
    signals, true, outgoing = [], [], []
    for _ in range(records):
        out_ns, echo_ns = rng.uniform(2.5, 3.5) * width, rng.uniform(0.45, 0.6) * forest.length_ns
        out = width * rng.uniform(0.92, 1.0)
        echo = width * (rng.uniform(1.0, 1.4) if rng.random() < forest.broadened else 1.0)
        height = np.exp(rng.uniform(*np.log([forest.lowest, forest.highest])))
        signal = height * pulse(times - echo_ns, echo, forest.skew, forest.ringing)
        if rng.random() < forest.further:
            behind = rng.uniform(0.8, 5.0) * width
            share = rng.uniform(0.2, 1.2)
            signal += share * height * pulse(times - echo_ns - behind, width, forest.skew, forest.ringing)
        if joined:
            signal += rng.uniform(80, 250) * pulse(times - out_ns, out, forest.skew, forest.ringing)
        signals.append(signal)
        outgoing.append(out_ns - rise * out)
        true.append(echo_ns - rise * echo - outgoing[-1])
    values = binned(1000 * times, np.array(signals), np.zeros(records), forest.length_ns - 1)
    zero = None if joined else 1000 * np.array(outgoing)
    times_ps = BIN_PS * (np.arange(forest.length_ns - 1) + 0.5)
    return Set(digitiser.read(values, rng), times_ps, 1000 * np.array(true), zero)


Case = Callable[[int, int], tuple[Set, OtherPulse]]


def _radar(world: str, fwhm_ps: float, digitiser: Digitiser, **further: float) -> Case:
    def make(records: int, seed: int) -> tuple[Set, OtherPulse]:
        other = OtherPulse(fwhm_ps, BIN_PS, code=digitiser.code, full_scale=digitiser.full_scale)
        return simulated(world, fwhm_ps, digitiser, records, seed, **further), other

    return make


def _drawn(forest: Forest, digitiser: Digitiser, *, joined: bool = True, said: float = 1.0) -> Case:
    """A drawn set, whose width the settings are told with a factor."""

    def make(records: int, seed: int) -> tuple[Set, OtherPulse]:
        width_ps = 1000 * said * forest.fwhm_ns
        other = OtherPulse(width_ps, BIN_PS, code=digitiser.code, full_scale=digitiser.full_scale)
        return airborne(forest, digitiser, records, seed, joined=joined), other

    return make


PLAIN, EIGHT = Digitiser(), Digitiser(bits=8, offset=8.0)
VOLTS = replace(PLAIN, code=2.0**-11)
CASES: dict[str, Case] = {
    "simulated, dissertation, 12 bit": _radar("dissertation", 5000.0, PLAIN),
    "simulated, clinic, 12 bit": _radar("clinic", 5000.0, PLAIN),
    "simulated, dissertation, 8 bit": _radar("dissertation", 5000.0, EIGHT, gain=3.0),
    "simulated, clinic, 8 bit": _radar("clinic", 5000.0, EIGHT, gain=3.0),
    "simulated, dissertation, 3 ns": _radar("dissertation", 3000.0, PLAIN),
    "simulated, clinic, 10 ns": _radar("clinic", 10000.0, PLAIN),
    "simulated, second echo": _radar("dissertation", 5000.0, PLAIN, second_mm=220.0),
    "simulated, saturated": _radar("dissertation", 5000.0, EIGHT, gain=6.0),
    "airborne, 5 ns": _drawn(Forest(), PLAIN),
    "airborne, 5 ns, time zero given": _drawn(Forest(), PLAIN, joined=False),
    "airborne, 2.2 ns": _drawn(Forest(fwhm_ns=2.2, length_ns=80), PLAIN),
    "airborne, 3 ns": _drawn(Forest(fwhm_ns=3.0, length_ns=90), PLAIN),
    "airborne, 10 ns": _drawn(Forest(fwhm_ns=10.0, length_ns=240), PLAIN),
    "airborne, 15 ns": _drawn(Forest(fwhm_ns=15.0, length_ns=360), PLAIN),
    "airborne, skew 2": _drawn(Forest(skew=2.0), PLAIN),
    "airborne, ringing 5 %": _drawn(Forest(ringing=0.05), PLAIN),
    "airborne, ringing 12 %": _drawn(Forest(ringing=0.12), PLAIN),
    "airborne, 8 bit, saturated": _drawn(Forest(lowest=30.0, highest=400.0), EIGHT),
    "airborne, 10 bit, noise 4": _drawn(Forest(lowest=40.0), Digitiser(bits=10, noise=4.0)),
    "airborne, noise 0.3": _drawn(Forest(), Digitiser(noise=0.3)),
    "airborne, volts": _drawn(Forest(), VOLTS),
    "airborne, width told 30 % too small": _drawn(Forest(), PLAIN, said=0.7),
    "airborne, width told 30 % too great": _drawn(Forest(), PLAIN, said=1.3),
}


def judge(case: Case, method: str, records: int, seed: int) -> Score:
    """Range a set with the settings of its pulse, and no more."""
    given, other = case(records, seed)
    found = estimate(
        given.traces,
        given.times_ps,
        method=method,
        settings=RangingSettings.for_pulse(other),
        learning=LearningSettings.for_pulse(other),
        reference_ps=given.zero_ps,
    )
    return Score.of(found, given.true_ps)


def main() -> None:
    """Print a row for each set and method."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--records", type=int, default=400)
    parser.add_argument("--only", default="")
    parser.add_argument("--method", choices=METHODS)
    asked = parser.parse_args()
    print(f"{'set':36} {'method':12}  ranged %  sd ns  beyond 0.6 ns, unflagged  flagged %")
    for name, case in CASES.items():
        if asked.only not in name:
            continue
        for method in [asked.method] if asked.method else METHODS:
            score = judge(case, method, asked.records, asked.seed)
            print(
                f"{name:36} {method:12} {100 * score.ranged:9.1f} {score.sd_ns:6.3f} {score.far:14d} "
                f"{score.unflagged:10d} {100 * score.flagged:10.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
