"""`DeviceTime`: when a measurement is made, in a form that a repeated or resumed scan finds again."""

from __future__ import annotations

from typing import TypeVar

from picoradar.sim.wires import Acquisition

K = TypeVar("K")
V = TypeVar("V")
REMEMBERED = 8192  # runs, and windows


class DeviceTime:
    """Two time axes, because a scan that is gone on with in another process has to give the same bytes.

    What changes over minutes follows the measurement's own count (run and record number times the length of a record)
    plus every break: time without a record, longer than ``break_s``. A scan that is gone on with in a new process
    has no break before it; a second scan after an hour's pause has one, and meets another drift.
    What changes within milliseconds follows the shots since the first one of the run; its phase at the start of a run
    is drawn by seed and run, because the host's own haste decides when a run begins.

    Parameters
    ----------
    break_s : float
        A pause that is longer counts.
    """

    def __init__(self, break_s: float) -> None:
        self._break_s = break_s
        self._breaks_s = 0.0
        self._last_s: float | None = None
        self._first_s: dict[tuple[int, int], float] = {}
        self._windows: dict[tuple[int, ...], tuple[float, int]] = {}

    def see(self, wanted: Acquisition) -> int:
        """Note that a window is taken, before anything else is asked; gives `shots_of_run`."""
        run, repeat, record, window = wanted.key
        if self._last_s is not None and wanted.start_s - self._last_s > self._break_s:
            self._breaks_s += wanted.start_s - self._last_s
        self._last_s = wanted.start_s + wanted.sweeps * (wanted.samples + wanted.settle_shots) / wanted.prf_hz
        found = self._windows.get(wanted.key)
        if found is None or not 0 <= wanted.start_s - found[0] < self._break_s:
            if (run, repeat) not in self._first_s or (record == 0 and window == 0):
                _keep(self._first_s, (run, repeat), wanted.start_s)
            shots = round((wanted.start_s - self._first_s[run, repeat]) * wanted.prf_hz)
            _keep(self._windows, wanted.key, (wanted.start_s, shots))
        return self.shots_of_run(wanted)

    def slow_s(self, wanted: Acquisition) -> float:
        """Get the time (s) for what changes over minutes."""
        record_s = wanted.sweeps * (wanted.samples + wanted.settle_shots) / wanted.prf_hz
        return (wanted.key[0] + wanted.key[2]) * record_s + self._breaks_s

    def shots_of_run(self, wanted: Acquisition) -> int:
        """Get the whole shots from the first one of the run to the first one of this window.

        A window that is repeated within ``break_s`` has those of its first attempt.
        """
        return self._windows[wanted.key][1]


def _keep(remembered: dict[K, V], key: K, value: V) -> None:
    """Remember a value, and forget the oldest when there are many."""
    remembered[key] = value
    if len(remembered) > REMEMBERED:
        del remembered[next(iter(remembered))]
