"""NumPy's own archive: everything known about each point, with its covariance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.line import LAST_ECHO
from picoradar.instrument.recording import Cloud


def arrays_of(cloud: Cloud) -> dict[str, NDArray[np.generic]]:
    """Return the arrays of an archive by name, points without a range left out; NaN where there is no last echo."""
    points = cloud.with_range()
    return {
        "points_mm": points.points_mm,
        "covariance_mm2": points.covariance_mm2,
        "range_mm": points.range_mm,
        "range_variance_mm2": points.range_variance_mm2,
        "response_mv": points.response_mv,
        "flags": points.flags,
        "row": points.rows,
        "column": points.columns,
        "angles_rad": points.angles_rad,
        "origin_mm": np.zeros(3),
        **{name: getattr(points, name) for name in LAST_ECHO},
    }


def write_npz(path: Path, arrays: dict[str, NDArray[np.generic]]) -> None:
    """Write the archive; the same arrays give the same bytes (NumPy dates every member 1980)."""
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def holds_npz(path: Path, arrays: dict[str, NDArray[np.generic]]) -> bool:
    """Return whether an archive reads back as the arrays."""
    with np.load(path, allow_pickle=False) as found:
        return set(found) == set(arrays) and all(
            found[name].dtype == values.dtype
            and found[name].shape == values.shape
            and found[name].tobytes() == values.tobytes()
            for name, values in arrays.items()
        )
