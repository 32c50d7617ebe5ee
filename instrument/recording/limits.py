"""Sizes that a recording may claim: checked when it is written, and before anything is unpacked when it is read."""

from __future__ import annotations

MOST_ROWS = 100_000
"""Lines of a scan; settings allow 1000, a monitor over a working day at 1 s has 30 000."""

MOST_COLUMNS = 100_000
"""Points of a line; settings allow 1000, a points plan may have more."""

MOST_SAMPLES = 1_000_000
"""Samples of a trace; settings allow 16384, the oscilloscope's longest record is shorter."""

LARGEST_LINE_BYTES = 125_000_000
"""Samples of one line, unpacked, bytes: 15.6 million samples, the most that acquisition ranges at once, of 8 bytes."""

LARGEST_VALUE_BYTES = 150_000_000
"""One value of the database, bytes: a line that compression made no smaller, and some room."""

TABLES = frozenset(
    {"scan", "line", "wave", "window", "zero", "echo", "stretch", "registration", "spare_header", "event"}
)
"""All that a recording consists of; a view or a trigger of these names could make values of any size, without end."""
