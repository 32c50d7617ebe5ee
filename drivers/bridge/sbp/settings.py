"""Configurations of the sampling bridge from the settings of a scan.

Source: protocol sheet ``sampling_bridge.md``, sections 2.3 and 10.
"""

from __future__ import annotations

from picoradar.drivers.bridge.sbp.codes import ConfigFlag
from picoradar.drivers.bridge.sbp.configuration import Configuration, femtoseconds
from picoradar.drivers.bridge.sbp.identity import Caps
from picoradar.drivers.bridge.sbp.limits import check_sweep
from picoradar.drivers.interfaces import SweepSettings


def sweep_configuration(device: str, sweep: SweepSettings, caps: Caps) -> Configuration:
    """Make the configuration of whole sweeps: external trigger, sums in 16 bits, one record.

    Raises
    ------
    LimitError
        When a value is outside the limits.
    """
    check_sweep(device, sweep, caps)
    return Configuration(
        start_fs=femtoseconds(sweep.start_ps),
        step_fs=femtoseconds(sweep.step_ps),
        samples=sweep.samples,
        averages=sweep.averages,
        flags=ConfigFlag.EXTERNAL_TRIGGER,
        records=1,
        prf_hz=round(sweep.prf_hz),
        settle_shots=sweep.settle_shots,
    )


def window_configuration(
    device: str, caps: Caps, *, prf_hz: float, settle_shots: int, on_advance: bool
) -> Configuration:
    """Make the configuration of records in windows (version 1.1); the window table says how many.

    Parameters
    ----------
    device : str
        The device's name for messages.
    caps : Caps
        Its limits.
    prf_hz : float
    settle_shots : int
    on_advance : bool
        Whether each record waits for an edge of the advance input.

    Raises
    ------
    LimitError
        When a value is outside the limits.
    """
    unused = SweepSettings(0.0, caps.step_min_fs / 1000, 1, 1, settle_shots, prf_hz)  # replaced by the window table
    sweeps = sweep_configuration(device, unused, caps)
    flags = sweeps.flags | ConfigFlag.WINDOWS | (ConfigFlag.ADVANCE if on_advance else ConfigFlag(0))
    return Configuration(
        start_fs=sweeps.start_fs,
        step_fs=sweeps.step_fs,
        samples=sweeps.samples,
        averages=sweeps.averages,
        flags=flags,
        records=0,
        prf_hz=sweeps.prf_hz,
        settle_shots=settle_shots,
    )
