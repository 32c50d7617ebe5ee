"""`DeviceTime`: when a measurement is made, in a form that a repeated or resumed scan finds again."""

from __future__ import annotations

from picoradar.sim.wires import Acquisition

REMEMBERED_RUNS = 4096


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

    def see(self, wanted: Acquisition) -> None:
        """Note that a window is taken; to be called before the others."""
        run, repeat, record, window = wanted.key
        if self._last_s is not None and wanted.start_s - self._last_s > self._break_s:
            self._breaks_s += wanted.start_s - self._last_s
        self._last_s = wanted.start_s + wanted.sweeps * (wanted.samples + wanted.settle_shots) / wanted.prf_hz
        if (run, repeat) not in self._first_s or (record == 0 and window == 0):
            self._first_s[run, repeat] = wanted.start_s
            if len(self._first_s) > REMEMBERED_RUNS:
                del self._first_s[next(iter(self._first_s))]

    def slow_s(self, wanted: Acquisition) -> float:
        """Get the time (s) for what changes over minutes."""
        record_s = wanted.sweeps * (wanted.samples + wanted.settle_shots) / wanted.prf_hz
        return (wanted.key[0] + wanted.key[2]) * record_s + self._breaks_s

    def shots_of_run(self, wanted: Acquisition) -> int:
        """Get the whole shots from the first one of the run to the first one of this window."""
        return round((wanted.start_s - self._first_s[wanted.key[0], wanted.key[1]]) * wanted.prf_hz)
