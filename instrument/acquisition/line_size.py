"""How large a line may be while it is ranged."""

from __future__ import annotations

from picoradar.instrument.errors import BadInput

BYTES_PER_SAMPLE = 64  # of a line in memory: codes, the trace in mV and what ranging needs beside it
MAX_LINE_BYTES = 1_000_000_000


def refuse_enormous_lines(columns: int, samples: int) -> None:
    """Refuse lines whose traces do not fit into memory while they are ranged, with the number.

    Raises
    ------
    BadInput
    """
    needed = columns * samples * BYTES_PER_SAMPLE
    if needed > MAX_LINE_BYTES:
        raise BadInput(
            f"a line of {columns} points with {samples} samples each needs about {needed / 1e9:.1f} GB of memory "
            f"to be ranged, more than {MAX_LINE_BYTES / 1e9:.0f} GB; take fewer columns or samples"
        )
