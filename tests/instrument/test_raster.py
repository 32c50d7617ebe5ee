"""The raster's places on its plane, its direction, and its refusals."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.drivers.errors import LimitError
from picoradar.instrument.acquisition import RasterPlan
from picoradar.instrument.calibration import ScannerErrors, codes_to_angles, true_angles
from picoradar.instrument.errors import BadInput


def on_plane(angles: np.ndarray, z: float, separation: float) -> np.ndarray:
    """Where beams meet the plane, by way of y / z = tan(ty) and x = (past + e) tan(tx)."""
    past = z / np.cos(angles[:, 1])
    return np.column_stack([(past + separation) * np.tan(angles[:, 0]), z * np.tan(angles[:, 1])])


ERRORS = ScannerErrors(x_scale=0.02, y_offset_rad=2e-3, non_orthogonality_rad=4e-3)


@pytest.mark.parametrize("errors", [ScannerErrors(), ERRORS])
def test_places_are_a_step_apart_on_the_plane_to_half_a_code(errors: ScannerErrors) -> None:
    raster = RasterPlan(rows=40, columns=30, step_mm=1.0, distance_mm=900.0, errors=errors)
    half_code_mm = np.deg2rad(10.0) / 4096 / 2 * 935
    for row in (0, 17, 39):
        line = raster.line(row)
        places = on_plane(true_angles(line.angles_rad, errors), 900.0, 30.0)
        np.testing.assert_allclose(places[:, 0], np.arange(30) - 14.5, atol=1.2 * half_code_mm)
        np.testing.assert_allclose(places[:, 1], 19.5 - row, atol=1.2 * half_code_mm)


def test_every_line_runs_left_to_right_from_a_lead_in_one_step_before() -> None:
    raster = RasterPlan(rows=3, columns=5, step_mm=2.0, distance_mm=800.0)
    for row in range(3):
        line = raster.line(row)
        np.testing.assert_array_equal(line.columns, np.arange(5))
        steps = np.diff(np.vstack([line.lead_in, line.codes])[:, 0])
        assert (steps > 0).all()
        assert np.ptp(steps) <= 1
        np.testing.assert_array_equal(line.angles_rad, codes_to_angles(line.codes, 10.0))


def test_row_zero_is_the_top() -> None:
    raster = RasterPlan(rows=2, columns=1, step_mm=5.0, distance_mm=900.0)
    assert raster.line(0).angles_rad[0, 1] > 0 > raster.line(1).angles_rad[0, 1]


@pytest.mark.parametrize(("rows", "columns"), [(1, 200), (200, 1)])
def test_a_raster_outside_the_span_is_refused(rows: int, columns: int) -> None:
    with pytest.raises(LimitError, match="outside its span"):
        RasterPlan(rows=rows, columns=columns, step_mm=1.0, distance_mm=900.0)


def test_the_lead_in_must_fit_too() -> None:
    widest = max(n for n in range(120, 180) if fits(n))
    raster = RasterPlan(rows=1, columns=widest, step_mm=1.0, distance_mm=900.0)
    assert raster.line(0).lead_in[0] >= 0
    assert raster.line(0).lead_in[0] < raster.line(0).codes[0, 0]


def fits(columns: int) -> bool:
    try:
        RasterPlan(rows=1, columns=columns, step_mm=1.0, distance_mm=900.0)
    except LimitError:
        return False
    return True


@pytest.mark.parametrize(
    ("change", "said"),
    [({"rows": 0}, "0 x 4"), ({"step_mm": 0.0}, "step 0 mm"), ({"distance_mm": float("nan")}, "distance nan")],
)
def test_a_raster_without_extent_is_refused(change: dict[str, float], said: str) -> None:
    sizes = {"rows": 3, "columns": 4, "step_mm": 1.0, "distance_mm": 900.0} | change
    with pytest.raises(BadInput, match=said):
        RasterPlan(**sizes)  # type: ignore[arg-type]


def test_a_row_that_is_not_there_is_refused() -> None:
    with pytest.raises(BadInput, match="rows 0 to 2"):
        RasterPlan(rows=3, columns=4, step_mm=1.0, distance_mm=900.0).line(3)
