"""Checks of configuration and window table, in the order of the sheet; what fails is refused.

Source: protocol sheet ``sampling_bridge.md``, sections 2.3 and 10.
"""

from __future__ import annotations

from picoradar.drivers.bridge.sbp import (
    VERSION_1_1,
    BadBlock,
    Caps,
    ConfigFlag,
    Configuration,
    ErrorCode,
    WindowEntry,
    decode_windows,
)

_DEAD_FS = 100_000_000  # the sweep has to end 100 ns before the next trigger
_FLAGS_1_0 = ConfigFlag.EXTERNAL_TRIGGER | ConfigFlag.TEST_PATTERN | ConfigFlag.GATE_BETWEEN
_FLAGS_1_1 = _FLAGS_1_0 | ConfigFlag.WINDOWS | ConfigFlag.ADVANCE


class Refused(Exception):
    """A request is refused: it stalls, and the code goes into the error queue.

    Parameters
    ----------
    code : ErrorCode
    detail : int
        The refused value.
    """

    def __init__(self, code: ErrorCode, detail: int = 0) -> None:
        super().__init__(f"{code.name}, detail {detail}")
        self.code = code
        self.detail = detail


def check_configuration(data: bytes, caps: Caps) -> Configuration:
    """Read the block of SET_CONFIG and check all its fields.

    Parameters
    ----------
    data : bytes
        The block.
    caps : Caps
        Limits of the device.

    Raises
    ------
    Refused
        With the code of the first check that fails.
    """
    if len(data) != Configuration.LENGTH or int.from_bytes(data[:2], "little") != Configuration.LENGTH:
        raise Refused(ErrorCode.BAD_LENGTH, len(data))
    try:
        configuration = Configuration.decode(data)
    except BadBlock as error:
        raise Refused(error.code, int.from_bytes(data[2:4], "little")) from error
    windows = caps.version >= VERSION_1_1 and bool(configuration.flags & ConfigFlag.WINDOWS)
    if not windows:  # otherwise the window table has them
        sweep = WindowEntry(
            configuration.start_fs, configuration.step_fs, configuration.samples, configuration.averages
        )
        check_window(sweep, configuration.prf_hz, caps)
    if not caps.prf_min_hz <= configuration.prf_hz <= caps.prf_max_hz:
        raise Refused(ErrorCode.PRF_RANGE, configuration.prf_hz)
    if configuration.format > 1 or not caps.formats >> configuration.format & 1:
        raise Refused(ErrorCode.FORMAT, configuration.format)
    known = _FLAGS_1_1 if caps.version >= VERSION_1_1 else _FLAGS_1_0
    if configuration.flags & ~known:
        raise Refused(ErrorCode.FLAGS, int(configuration.flags))
    return configuration


def check_windows(data: bytes, prf_hz: int, caps: Caps) -> list[tuple[WindowEntry, ...]]:
    """Read the block of SET_WINDOWS and check its entries.

    Parameters
    ----------
    data : bytes
        The block.
    prf_hz : int
    caps : Caps
        Limits of the device.

    Raises
    ------
    Refused
        With the code of the first check that fails; for an entry the detail is its number.
    """
    if len(data) < 12 or int.from_bytes(data[:2], "little") != len(data):
        raise Refused(ErrorCode.BAD_LENGTH, len(data))
    try:
        table = decode_windows(data)
    except BadBlock as error:
        raise Refused(error.code, int.from_bytes(data[2:4], "little")) from error
    width = int.from_bytes(data[4:6], "little")
    if not 1 <= width <= caps.windows_max:
        raise Refused(ErrorCode.BAD_VALUE, width)
    if not 1 <= len(table) * width <= caps.entries_max:
        raise Refused(ErrorCode.BAD_VALUE, len(table))
    for number, window in enumerate(w for record in table for w in record):
        try:
            check_window(window, prf_hz, caps)
        except Refused as refused:
            raise Refused(refused.code, number) from refused
    return table


def check_window(window: WindowEntry, prf_hz: int, caps: Caps) -> None:
    """Check start, step, samples and sweeps.

    Parameters
    ----------
    window : Window
    prf_hz : int
    caps : Caps
        Limits of the device.

    Raises
    ------
    Refused
        With the code of the first check that fails.
    """
    if not caps.step_min_fs <= window.step_fs <= caps.step_max_fs:
        raise Refused(ErrorCode.STEP_RANGE, window.step_fs)
    if window.step_fs % caps.resolution_fs:
        raise Refused(ErrorCode.STEP_RESOLUTION, window.step_fs)
    if window.start_fs % caps.resolution_fs:
        raise Refused(ErrorCode.STEP_RESOLUTION, window.start_fs & 0xFFFFFFFF)
    if not 1 <= window.samples <= caps.depth:
        raise Refused(ErrorCode.COUNT_RANGE, window.samples)
    last_fs = window.start_fs + window.step_fs * (window.samples - 1)
    period_fs = 10**15 // prf_hz if prf_hz else caps.delay_max_fs + _DEAD_FS + 1
    if last_fs > caps.delay_max_fs or last_fs >= period_fs - _DEAD_FS:
        raise Refused(ErrorCode.WINDOW_RANGE, min(last_fs // 1000, 0xFFFFFFFF))
    if not 1 <= window.sweeps <= caps.averages_max or window.sweeps * 255 > 0xFFFF:
        raise Refused(ErrorCode.AVERAGES_RANGE, window.sweeps)


def u32(data: bytes) -> int:
    """Read a data stage of one u32.

    Raises
    ------
    Refused
    """
    if len(data) != 4:
        raise Refused(ErrorCode.BAD_LENGTH, len(data))
    return int.from_bytes(data, "little")


def expect_empty(data: bytes) -> None:
    """Check that there is no data stage.

    Raises
    ------
    Refused
    """
    if data:
        raise Refused(ErrorCode.BAD_LENGTH, len(data))


def flag(value: int) -> bool:
    """Read a wValue that is 0 or 1.

    Raises
    ------
    Refused
    """
    if value > 1:
        raise Refused(ErrorCode.BAD_VALUE, value)
    return value == 1
