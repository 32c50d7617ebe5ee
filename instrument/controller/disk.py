"""Room on the disk of the recording, counted in lines."""

from __future__ import annotations

import shutil

from picoradar.instrument.controller.job import LineStore, ScanJob
from picoradar.instrument.errors import InterlockTripped


def lines_left(job: ScanJob, store: LineStore) -> float:
    """Get the number of lines for which the disk still has room."""
    return shutil.disk_usage(store.path.parent).free / job.line_bytes


def refuse_small_disk(job: ScanJob, store: LineStore) -> None:
    """Refuse a scan that the disk cannot take, with the numbers.

    Raises
    ------
    InterlockTripped
    """
    needed = len(job.rows) * job.line_bytes
    free = shutil.disk_usage(store.path.parent).free
    if needed > free:
        raise InterlockTripped(
            "disk space",
            f"{len(job.rows)} lines take up to {needed / 1e9:.3g} GB, {free / 1e9:.3g} GB are free in "
            f"{store.path.parent}; make room, or take fewer points or no traces",
        )
