"""A waveform of the oscilloscope as a `Record`, the form that ranging takes.

Source: protocol sheet ``dca_scpi_waveform.md``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.interfaces import Record
from picoradar.drivers.oscilloscope.waveform import (
    CLIPPED_HIGH,
    CLIPPED_LOW,
    HOLE,
    MAX_CODE,
    MIN_CODE,
    BadWaveform,
    Preamble,
)


def waveform_record(preamble: Preamble, codes: NDArray[np.int16], *, run_id: int, number: int, time_us: int) -> Record:
    """Make a record of the codes of a waveform.

    Parameters
    ----------
    preamble : Preamble
    codes : (n,) int16 array
        In format WORD.
    run_id, number, time_us : int
        Of the record.

    Returns
    -------
    Record
        Sums are the codes of one sweep, shifted to be positive; a clipped sample is at the end of the scale.

    Raises
    ------
    BadWaveform
        When samples are missing: gaps are never filled.
    """
    high, low = codes == CLIPPED_HIGH, codes == CLIPPED_LOW
    missing = int(((codes >= HOLE) & ~high & ~low).sum())
    if missing:
        raise BadWaveform(f"{missing} of {len(codes)} samples were not taken")
    held = np.where(high, MAX_CODE, np.where(low, MIN_CODE, codes)).astype(np.int32)
    zero_code = preamble.y_reference - preamble.y_origin / preamble.y_increment
    return Record(
        run_id=run_id,
        number=number,
        sums=(held - MIN_CODE).astype(np.uint32),
        sweeps=1,
        times_ps=preamble.times_s() * 1e12,
        zero_code=zero_code - MIN_CODE,
        mv_per_code=preamble.y_increment * 1e3,
        clipped=bool(high.any() or low.any()),
        trigger_lost=False,
        device_time_us=time_us,
    )
