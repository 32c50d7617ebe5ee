"""The safe shutdown: every barrier before the laser is closed and read back, whatever failed before."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from picoradar.instrument.bench import Bench

VERIFIED = "verified"
STEP_OF = {"gate": "sampler", "pulser": "pulser", "run": "sampler", "mirrors": "galvo", "diode": "diode"}
"""Steps of the safe shutdown in their order, and the device of each."""


@dataclass(frozen=True)
class SafeState:
    """Outcome of one safe shutdown.

    Attributes
    ----------
    steps : dict
        For each step ``"verified"`` (read back from the device) or what went wrong.
    """

    steps: dict[str, str] = field(default_factory=dict)

    @property
    def laser_off_verified(self) -> bool:
        """Get whether the light is proven off: gate or triggers-and-supply, either of which suffices, read back."""
        return VERIFIED in (self.steps.get("gate"), self.steps.get("pulser"))

    @property
    def complete(self) -> bool:
        """Get whether every single step was verified."""
        return all(outcome == VERIFIED for outcome in self.steps.values())

    def __str__(self) -> str:
        laser = "laser off verified" if self.laser_off_verified else "LASER NOT VERIFIED OFF: open the interlock"
        open_points = [f"{name}: {outcome}" for name, outcome in self.steps.items() if outcome != VERIFIED]
        return "; ".join([laser, *open_points])


class SafeShutdown:
    """`make_safe` for one bench, which remembers its last outcome, also when what called it was broken off.

    Parameters
    ----------
    bench : Bench

    Attributes
    ----------
    last : SafeState
        Outcome of the last one that came to its end; without steps before the first.
    alone : RLock
        Held meanwhile, and while links are opened and closed: a second thread in the middle of an exchange would take
        the answers of the first.
    """

    def __init__(self, bench: Bench) -> None:
        self.last = SafeState()
        self.alone = threading.RLock()
        self._bench = bench

    def __call__(self, *, blamed: BaseException | None = None, diode_off: bool = False) -> SafeState:
        """Bring everything to its safe state; parameters and what is raised as for `make_safe`."""
        suspected = self._bench.suspected(blamed) if blamed is not None else ""
        with self.alone:
            self.last = make_safe(self._bench, suspected=suspected, diode_off=diode_off)
            return self.last


def make_safe(bench: Bench, *, suspected: str = "", diode_off: bool = False) -> SafeState:
    """Close the gate, stop triggers and supply, end the run, park the mirrors; each tried, each read back.

    Never raises an `Exception`: a step that fails is written down and the next one is tried.

    Parameters
    ----------
    bench : Bench
    suspected : str, optional
        Device whose failure led here: its steps come last, for they may cost the time of an answer that never comes.
    diode_off : bool, optional
        Switch the diode's controller off as well.

    Raises
    ------
    BaseException
        What is no `Exception` (a second Ctrl-C, the end of the interpreter), after all steps have been tried.
    """
    steps: dict[str, Callable[[], None]] = {
        "gate": bench.sampler.gate_off,
        "pulser": bench.pulser.off,
        "run": bench.sampler.stop,
        "mirrors": bench.galvo.park,
    }
    if diode_off:
        steps["diode"] = bench.diode.off
    outcome: dict[str, str] = {}
    broken_off: BaseException | None = None
    for name in sorted(steps, key=lambda step: STEP_OF[step] == suspected):
        try:
            steps[name]()
        except Exception as error:  # noqa: BLE001 - no failure, of whatever kind, may keep the next step from being tried
            outcome[name] = words_of(error)
        except BaseException as error:  # noqa: BLE001 - raised again below, after the other steps
            outcome[name] = words_of(error)
            broken_off = error
        else:
            outcome[name] = VERIFIED
    if broken_off is not None:
        raise broken_off
    return SafeState(outcome)


def words_of(error: BaseException) -> str:
    """Put an error, and what failed beside it, into one line."""
    return "; ".join([str(error) or type(error).__name__, *getattr(error, "__notes__", [])])
