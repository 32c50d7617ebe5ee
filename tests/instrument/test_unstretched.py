"""Whole scans corrected by the stretch of their echoes: known answers, and how true the stated deviation is."""

from __future__ import annotations

import math
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from picoradar.instrument.line import LAST_ECHO, ScanLine, StretchTerms, Unstretched, unstretched
from picoradar.instrument.recording import Recording, RecordingError, salvage

TERMS = StretchTerms(bias_mm=3.2, rest_mm=0.15, piece_sd=0.25, power=0.45, power_sd=0.05, law_sd=0.03)
TRANSFER_MM = TERMS.bias_mm * TERMS.power * TERMS.piece_sd


def raster(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    row, column = np.divmod(np.arange(rows * columns), columns)
    return row.astype(np.int32), column.astype(np.int32)


def corrected(true: np.ndarray, sd: float, seed: int, terms: StretchTerms = TERMS) -> Unstretched:
    """Stretch (rows, columns) seen with noise."""
    noisy = true.ravel() + sd * np.random.default_rng(seed).standard_normal(true.size)
    found = unstretched(terms, noisy, np.full(true.size, sd**2), *raster(*true.shape))
    assert found is not None
    return found


def test_what_the_echoes_cannot_tell_stays_as_the_calibration_has_it() -> None:
    found = corrected(np.full((20, 20), 0.3), 200.0, 1)
    assert np.abs(found.change_mm).max() < 0.05 * TRANSFER_MM
    assert found.stretch == pytest.approx(1.0, abs=0.02)
    assert found.sd_mm == pytest.approx(math.hypot(TERMS.rest_mm, TRANSFER_MM), rel=0.01)
    nothing = np.full(6, np.nan)
    assert unstretched(TERMS, nothing, nothing, *raster(2, 3)) is None


@pytest.mark.parametrize("sd", [0.08, 0.4])
def test_paint_beside_bone_gets_no_bias_and_bone_keeps_its_own(sd: float) -> None:
    true = np.ones((30, 40))
    true[:, :20] = 0.0
    change = corrected(true, sd, 2).change_mm.reshape(true.shape)
    assert change[:, :16].mean() == pytest.approx(TERMS.bias_mm, abs=0.15)
    assert change[:, 24:].mean() == pytest.approx(0.0, abs=0.1)
    assert np.sqrt(np.mean((change[:, :16] - TERMS.bias_mm) ** 2)) < 0.3


def test_paint_that_seems_to_be_stretched_by_a_pulse_that_is_not_quite_as_calibrated_stays_paint() -> None:
    """0.03 to the power is a fifth of the bias of bone; that much a bench's own pulse may feign."""
    true = np.ones((30, 40))
    true[:, :20] = 0.03
    found = corrected(true, 0.05, 7)
    change = found.change_mm.reshape(true.shape)[:, :16]
    assert change.mean() > 0.92 * TERMS.bias_mm
    left_mm2 = np.mean((change - TERMS.bias_mm) ** 2)
    assert left_mm2 < 2 * found.variance_mm2.reshape(true.shape)[:, :16].mean()


def test_another_tissue_is_corrected_by_the_power_of_its_stretch() -> None:
    found = corrected(np.full((40, 40), 0.4), 0.4, 3)
    assert found.change_mm.mean() == pytest.approx(TERMS.bias_mm * (1 - 0.4**0.45), abs=0.12)
    of_law = TERMS.bias_mm * 0.4**0.45 * math.hypot(0.03, 0.05 * math.log(0.4))
    assert math.hypot(TERMS.rest_mm, 0.9 * of_law) < found.sd_mm < math.hypot(TERMS.rest_mm, TRANSFER_MM)


def test_the_common_deviation_is_true() -> None:
    """Pieces whose stretch differs as `piece_sd` says, of a law that differs as it says: error over stated, squared."""
    rng, terms, ratios = np.random.default_rng(4), TERMS._replace(rest_mm=0.0), []
    for seed in range(150):
        stretch, law = 1.0 + terms.piece_sd * rng.standard_normal(), 1.0 + terms.law_sd * rng.standard_normal()
        stretch = max(stretch, 0.1)
        power = terms.power + terms.power_sd * rng.standard_normal()
        seen = stretch + 0.03 * rng.standard_normal()  # a pulse that is not quite the calibration's
        found = corrected(np.full((8, 10), seen), 0.6, seed, terms)
        left_mm = terms.bias_mm * (stretch**power * law - 1.0) + found.change_mm.mean()
        ratios.append(left_mm**2 / found.sd_mm**2)
    assert np.mean(ratios) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 150))


def test_the_order_of_the_points_makes_no_difference_and_holes_none_but_there() -> None:
    true = np.where(np.arange(400).reshape(20, 20) % 20 < 10, 0.2, 1.0)
    share = true.ravel() + 0.1 * np.random.default_rng(5).standard_normal(400)
    variance, (rows, columns) = np.full(400, 0.01), raster(20, 20)
    share[[30, 215]] = np.nan
    one = unstretched(TERMS, share, variance, rows, columns)
    order = np.random.default_rng(6).permutation(400)
    other = unstretched(TERMS, share[order], variance[order], rows[order], columns[order])
    assert one is not None
    assert other is not None
    np.testing.assert_allclose(other.change_mm, one.change_mm[order], atol=1e-9)
    np.testing.assert_allclose(one.change_mm[[30, 215]], one.change_mm[[50, 195]], atol=0.2)  # of the lines beside


def test_columns_that_no_raster_has_take_no_memory() -> None:
    columns = np.array([0, 2**30, -(2**30)], dtype=np.int32)
    found = unstretched(TERMS, np.array([1.0, 0.9, 1e300]), np.full(3, 0.01), np.arange(3, dtype=np.int32), columns)
    assert found is not None
    assert np.isfinite(found.change_mm).all()


def line(index: int, stretch: np.ndarray | None) -> ScanLine:
    points = np.column_stack([np.arange(5.0), np.full(5, float(index)), np.full(5, 900.0)])
    return ScanLine(
        index=index,
        columns=np.arange(5, dtype=np.int32),
        angles_rad=points[:, :2] / 900.0,
        points_mm=points,
        covariance_mm2=np.tile(np.eye(3) * 0.01, (5, 1, 1)),
        range_mm=np.linalg.norm(points, axis=1),
        range_variance_mm2=np.full(5, 0.01),
        response_mv=np.full(5, 40.0),
        flags=np.zeros(5, dtype=np.uint16),
        traces=None,
        sweeps=8,
        device_time_s=float(index),
        stretch=stretch,
    )


BONE = {"material": "bone", "bias_mm": 3.2, "sd_mm": 0.4}
HEADER = {"raster": {"rows": 4, "columns": 5, "step_mm": 1.0}, "range_error": BONE, "stretch": TERMS._asdict()}


def test_a_recording_keeps_the_stretch_and_its_cloud_is_corrected(tmp_path: Path) -> None:
    seen = np.tile([0.5, 0.001], (5, 1))
    with Recording.create(tmp_path / "scan.db", HEADER) as scan:
        for index in range(3):
            scan.append(line(index, seen))
        scan.append(line(3, None))
        scan.finish("finished", laser_off_verified=True)
    with Recording.open(tmp_path / "scan.db") as scan:
        kept, without = scan.line(0), scan.line(3)
        assert kept.stretch is not None
        assert kept.stretch.tobytes() == seen.tobytes()
        assert without.stretch is None
        np.testing.assert_array_equal(kept.range_mm, line(0, seen).range_mm)  # a line by itself is not corrected
        cloud, error = scan.cloud(), scan.range_error
    change = cloud.range_mm - np.concatenate([line(k, None).range_mm for k in range(4)])
    np.testing.assert_allclose(change, 3.2 * (1 - 0.5**0.45), atol=0.1)
    np.testing.assert_allclose(np.linalg.norm(cloud.points_mm, axis=1), cloud.range_mm, atol=1e-9)
    along = np.einsum("ni,nij,nj->n", cloud.beams, cloud.covariance_mm2, cloud.beams)
    np.testing.assert_allclose(along, cloud.range_variance_mm2, atol=1e-9)
    assert (error["material"], error["bias_mm"]) == ("bone", 3.2)
    assert error["sd_mm"] < 0.4
    assert error["stretch"] == pytest.approx(0.5, abs=0.05)
    assert len(cloud.where(cloud.rows == 0)) == 5


SEEN = np.array([[0.5, 0.001], [0.6, 0.002], [np.nan, np.nan], [0.7, 0.003], [0.4, 0.002]])


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Make a recording whose second place of each line has two echoes; the line in the middle knows no stretch."""
    place = np.arange(5) == 2
    with Recording.create(tmp_path / "scan.db", HEADER) as scan:
        for index in range(3):
            one = line(index, None if index == 1 else SEEN)
            last = {
                name: np.where(place.reshape(-1, *[1] * len(shape)), 912.0 + index, np.full((5, *shape), np.nan))
                for name, shape in LAST_ECHO.items()
            }
            scan.append(replace(one, **last))
    return tmp_path / "scan.db"


def test_the_last_of_two_echoes_is_not_corrected(path: Path) -> None:
    with Recording.open(path) as scan:
        cloud, first = scan.cloud(), scan.line(0)
    assert np.flatnonzero(cloud.two_echoes).tolist() == [2, 7, 12]
    assert cloud.last_range_mm[cloud.two_echoes].tolist() == [912.0, 913.0, 914.0]
    assert (cloud.last_points_mm[cloud.two_echoes][:, 0]).tolist() == [912.0, 913.0, 914.0]
    assert (cloud.range_mm[:5] - first.range_mm > 0.3).all()  # the first is, as all around it


@pytest.mark.parametrize(
    "damage",
    [
        "UPDATE stretch SET data = zeroblob(80) WHERE k = 2",
        "UPDATE stretch SET data = 'text' WHERE k = 2",
        "UPDATE stretch SET n = 4 WHERE k = 2",
        "DELETE FROM stretch WHERE k = 2",
        "DELETE FROM echo WHERE k = 2",
    ],
)
def test_a_line_whose_stretch_is_damaged_or_lost_is_damaged(path: Path, damage: str) -> None:
    with closing(sqlite3.connect(path)) as raw, raw:
        raw.execute(damage)
    with Recording.open(path) as scan:
        assert [check.index for check in scan.check() if not check.ok] == [2]
        with pytest.raises(RecordingError, match="the line is damaged"):
            scan.line(2, traces=False)
    new, kept, lost = salvage(path)
    assert (kept, lost) == ([0, 1], [2, 3])
    with Recording.open(new) as found:
        np.testing.assert_array_equal(found.line(0).stretch, SEEN)
        assert found.line(0).two_echoes.sum() == 1
        assert found.line(1).stretch is None
    with Recording.resume(path) as going_on:
        assert going_on.missing == [2, 3]
        going_on.append(line(2, SEEN))
        np.testing.assert_array_equal(going_on.line(2).stretch, SEEN)


def test_a_stretch_of_other_echoes_than_those_of_the_line_is_refused(path: Path) -> None:
    with Recording.resume(path) as scan, pytest.raises(RecordingError, match="stretch has the shape"):
        scan.append(line(3, SEEN[:4]))


def test_a_recording_from_before_the_stretch_opens_and_goes_on(path: Path) -> None:
    with closing(sqlite3.connect(path)) as raw, raw:
        raw.executescript("PRAGMA foreign_keys=ON; DELETE FROM line; DROP TABLE echo; DROP TABLE stretch;")
        raw.execute("PRAGMA user_version=3")
    with Recording.open(path) as old:
        assert old.done == []
    with Recording.resume(path) as going_on:
        going_on.append(line(0, SEEN))
    with Recording.open(path) as whole:
        np.testing.assert_array_equal(whole.line(0).stretch, SEEN)


@pytest.mark.parametrize(
    "wrong", [{**TERMS._asdict(), "power": 0.0}, {"bias_mm": 3.0}, {**TERMS._asdict(), "rest_mm": "x"}]
)
def test_terms_that_are_none_are_refused(tmp_path: Path, wrong: dict[str, object]) -> None:
    with pytest.raises(RecordingError, match="stretch"):
        Recording.create(tmp_path / "scan.db", {**HEADER, "stretch": wrong})
