"""`plan_path`: the path of a line as the galvo controller plays it, with a mark where each record begins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.errors import BadInput

FINEST_HZ = 10_000  # points a second of a path; more would take longer to send than they save
COARSEST_HZ = 1000
LONGEST_PATH = 4000  # points that the galvo controller holds
SPARE_S = 5e-5  # four shots at 80 kHz between the end of a record and the next mark: an edge inside a record is lost
SENT_PER_S = 173_000  # points of 7 bytes: full speed USB moves at most 19 packets of 64 bytes a millisecond


class Stop(NamedTuple):
    """A point of a path: ``codes`` (x, y) of the mirrors, ``wait_s`` from the step to the mark that begins the record,
    and ``record_s``, how long that takes."""

    codes: NDArray[np.int64]
    wait_s: float
    record_s: float


class GalvoPath(NamedTuple):
    """Codes (n, 2), where the marker line is high (n,), and points a second."""

    codes: NDArray[np.int64]
    marked: NDArray[np.bool_]
    rate_hz: int


def plan_path(lead_in: NDArray[np.int64], lead_s: float, stops: Sequence[Stop]) -> GalvoPath:
    """Plan a path: the lead-in, then each point until its record is done.

    The mirrors stand at the lead-in already when the path is sent. It is played once it is there as a whole, so the
    time that it needs at least on its way is part of the wait at the lead-in.

    Parameters
    ----------
    lead_in : (2,) int array
    lead_s : float
        How long the mirrors still have to rest at the lead-in.
    stops : sequence of Stop

    Raises
    ------
    BadInput
        When the line takes so long that the path does not fit into the galvo controller.
    """
    total_s = lead_s + sum(stop.wait_s + stop.record_s + SPARE_S for stop in stops)
    rate_hz = min(FINEST_HZ, int((LONGEST_PATH - 2 * len(stops) - 1) / total_s))
    if rate_hz < COARSEST_HZ:
        raise BadInput(f"{len(stops)} points take {total_s:.2f} s, too long for one path; scan fewer columns")
    waits = [math.ceil(stop.wait_s * rate_hz) for stop in stops]
    records = [math.ceil((stop.record_s + SPARE_S) * rate_hz) for stop in stops]
    rest_s = lead_s - (sum(waits) + sum(records)) / SENT_PER_S
    counts = [max(1, math.ceil(rest_s * rate_hz)), *(w + r for w, r in zip(waits, records, strict=True))]
    codes = np.repeat(np.vstack([lead_in, *(stop.codes for stop in stops)]), counts, axis=0)
    marked = np.zeros(len(codes), dtype=np.bool_)
    marked[np.cumsum(counts[:-1]) + waits] = True
    return GalvoPath(codes, marked, rate_hz)
