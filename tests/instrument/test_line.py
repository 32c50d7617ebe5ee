"""Lines hand on beams and ranges, so that nobody has to compute them from the points again."""

from __future__ import annotations

import numpy as np

from picoradar.drivers.traces import CodeScale, Trace
from picoradar.instrument.line import ORIGIN_MM, Flag, ScanLine
from picoradar.instrument.recording import cloud_of
from picoradar.registration.scan import checked_scan


def make_line(index: int, count: int = 12) -> ScanLine:
    rng = np.random.default_rng(index)
    points = rng.normal(size=(count, 3)) * [20, 20, 5] + [0, 0, 900]
    flags = np.zeros(count, dtype=np.uint16)
    flags[3], points[3] = Flag.NO_ECHO, np.nan
    return ScanLine(
        index=index,
        columns=np.arange(count, dtype=np.int32),
        angles_rad=np.zeros((count, 2)),
        points_mm=points,
        covariance_mm2=np.tile(np.eye(3), (count, 1, 1)),
        range_mm=np.linalg.norm(points, axis=1),
        range_variance_mm2=np.ones(count),
        response_mv=np.full(count, 40.0),
        flags=flags,
        traces=Trace(np.zeros((count, 5), dtype=np.uint16), 8, np.arange(5.0), CodeScale(32.0, 0.5)),
        sweeps=8,
        device_time_s=float(index),
    )


def test_beams_are_those_that_a_registration_takes_to_the_last_bit() -> None:
    cloud = cloud_of([make_line(0), make_line(1)]).with_range()
    scan = checked_scan(cloud.points_mm, origin=ORIGIN_MM)
    assert np.array_equal(cloud.beams, scan.beams)
    assert np.array_equal(np.concatenate([make_line(k).beams[make_line(k).has_range] for k in (0, 1)]), scan.beams)


def test_beams_are_unit_vectors_to_the_points_and_computed_once() -> None:
    line = make_line(2)
    assert np.isnan(line.beams[3]).all()
    there = line.has_range
    np.testing.assert_allclose((line.beams * line.range_mm[:, None])[there], line.points_mm[there])
    assert line.beams is line.beams


def test_a_cloud_has_its_lines_in_the_order_of_the_raster() -> None:
    cloud = cloud_of([make_line(2), make_line(0), make_line(1)])
    assert cloud.rows.tolist() == [row for row in range(3) for _ in range(12)]
    assert np.array_equal(cloud.points_mm[12:24], make_line(1).points_mm, equal_nan=True)


def test_a_line_without_its_raw_samples_is_the_same_line() -> None:
    line = make_line(0)
    light = line.without_raw_samples()
    assert light.traces is None
    assert light.sums is None
    assert light.points_mm is line.points_mm
    assert line.sums is not None
