"""Checks of sweeps and window tables against the limits that a sampling bridge has reported, before anything is sent.

Source: protocol sheet ``sampling_bridge.md``, sections 2.2, 2.3 and 10.
"""

from __future__ import annotations

from collections.abc import Sequence

from picoradar.drivers.bridge.sbp.configuration import WindowEntry, femtoseconds
from picoradar.drivers.bridge.sbp.identity import Caps
from picoradar.drivers.errors import LimitError, check_range
from picoradar.drivers.interfaces import SweepSettings

DEAD_PS = 100_000.0  # a sweep ends at least 100 ns before the next trigger


def check_sweep(device: str, sweep: SweepSettings, caps: Caps) -> None:
    """Check all values of a configuration.

    Parameters
    ----------
    device : str
        The device's name for messages.
    sweep : SweepSettings
    caps : Caps
        Its limits.

    Raises
    ------
    LimitError
        With the value and the range.
    """
    check_range(device, "PRF", sweep.prf_hz, caps.prf_min_hz, caps.prf_max_hz, "Hz")
    if sweep.prf_hz != round(sweep.prf_hz):
        raise LimitError(device, f"PRF {sweep.prf_hz} Hz is not a whole number; nothing was sent")
    check_range(device, "settle shots", sweep.settle_shots, 0, 0xFFFF)
    check_range(device, "start delay", sweep.start_ps, 0.0, caps.delay_max_fs / 1000, "ps")
    check_range(device, "step", sweep.step_ps, caps.step_min_fs / 1000, caps.step_max_fs / 1000, "ps")
    for name, value_ps in (("start delay", sweep.start_ps), ("step", sweep.step_ps)):
        if abs(femtoseconds(value_ps) - value_ps * 1000) > 1e-3:
            raise LimitError(device, f"{name} {value_ps!r} ps is not a whole number of femtoseconds; nothing was sent")
    window = WindowEntry(femtoseconds(sweep.start_ps), femtoseconds(sweep.step_ps), sweep.samples, sweep.averages)
    check_window(device, window, round(sweep.prf_hz), caps)


def check_table(device: str, table: Sequence[Sequence[WindowEntry]], prf_hz: int, caps: Caps) -> None:
    """Check a table of windows.

    Parameters
    ----------
    device : str
        The device's name for messages.
    table : sequence of sequences of Window
        Windows of each record.
    prf_hz : int
    caps : Caps
        Its limits.

    Raises
    ------
    LimitError
        With the value and the range; for an entry also its record and window number.
    """
    widths = {len(record) for record in table}
    if len(widths) != 1:
        raise LimitError(device, f"records of {sorted(widths)} windows; all need the same number; nothing was sent")
    width = widths.pop()
    check_range(device, "windows in a record", width, 1, caps.windows_max)
    check_range(device, "entries in the window table", width * len(table), 1, caps.entries_max)
    for m, record in enumerate(table):
        for w, window in enumerate(record):
            check_window(f"{device}, record {m}, window {w}", window, prf_hz, caps)


def check_window(device: str, window: WindowEntry, prf_hz: int, caps: Caps) -> None:
    """Check start, step, samples and sweeps of one sweep or window.

    Parameters
    ----------
    device : str
        The device's name for messages.
    window : Window
    prf_hz : int
    caps : Caps
        Its limits.

    Raises
    ------
    LimitError
        With the value and the range.
    """
    check_range(device, "step", window.step_fs / 1000, caps.step_min_fs / 1000, caps.step_max_fs / 1000, "ps")
    for name, value_fs in (("start delay", window.start_fs), ("step", window.step_fs)):
        if value_fs % caps.resolution_fs:
            unit_ps = caps.resolution_fs / 1000
            raise LimitError(
                device, f"{name} {value_fs / 1000:.10g} ps is not a multiple of {unit_ps:g} ps; nothing was sent"
            )
    check_range(device, "samples", window.samples, 1, caps.depth)
    check_range(device, "averages", window.sweeps, 1, min(caps.averages_max, 0xFFFF // 255))
    last_ps = (window.start_fs + window.step_fs * (window.samples - 1)) / 1000
    # The last instant lies strictly before the dead time, hence the one femtosecond.
    max_ps = min(caps.delay_max_fs / 1000, 1e12 / prf_hz - DEAD_PS - 1e-3)
    check_range(device, "last sampling instant", last_ps, 0.0, max_ps, "ps")
