"""`raster_of`: the raster that the settings ask for, refused when it cannot be scanned."""

from __future__ import annotations

from picoradar.instrument.acquisition.raster import Raster
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.errors import BadInput
from picoradar.instrument.settings import Settings

BYTES_PER_SAMPLE = 64  # of a line in memory: codes, the trace in mV and what ranging needs beside it
MOST_LINE_BYTES = 1_000_000_000


def raster_of(settings: Settings, calibration: Calibration) -> Raster:
    """Lay the raster of the settings out for a calibrated scanner.

    Raises
    ------
    LimitError
        When it does not fit into the scanner's span.
    BadInput
        When one of its lines does not fit into memory.
    """
    _refuse_enormous_lines(settings)
    scan = settings.scan
    return Raster(
        rows=scan.rows,
        columns=scan.columns,
        step_mm=scan.step_mm,
        distance_mm=scan.distance_mm,
        field_deg=settings.scanner.field_deg,
        separation_mm=calibration.mirror_separation_mm,
        errors=calibration.scanner,
    )


def _refuse_enormous_lines(settings: Settings) -> None:
    """Refuse lines whose traces do not fit into memory while they are ranged, with the number.

    Raises
    ------
    BadInput
    """
    columns, samples = settings.scan.columns, settings.sampler.samples
    needed = columns * samples * BYTES_PER_SAMPLE
    if needed > MOST_LINE_BYTES:
        raise BadInput(
            f"a line of {columns} places with {samples} samples each needs about {needed / 1e9:.1f} GB of memory "
            f"to be ranged, more than {MOST_LINE_BYTES / 1e9:.0f} GB; take fewer columns or samples"
        )
