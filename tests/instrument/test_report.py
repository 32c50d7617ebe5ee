"""The report: what a person sees, complete in one folder."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar.drivers.traces import CodeScale, Trace
from picoradar.instrument.line import Flag, ScanLine
from picoradar.instrument.recording import Recording
from picoradar.instrument.report import RegisteredScan, Surface, write_report
from picoradar.instrument.report.style import classes_of
from picoradar.instrument.report.waveform import time_significant_points
from picoradar.registration import Tolerance

ROWS, COLUMNS, SAMPLES, STEP_PS, START_PS = 12, 14, 700, 13.4, 6500.0
HEADER = {
    "seed": 1,
    "settings": {"note": "<script>alert(1)</script>"},
    "raster": {"rows": ROWS, "columns": COLUMNS, "step_mm": 3.0, "mode": "sweep", "averages": 8},
    "trace": {"start_ps": START_PS, "step_ps": STEP_PS, "samples": SAMPLES, "zero_code": 40.0, "mv_per_code": 0.5},
}


@dataclass
class Entry:
    stage: str
    rms_mm: float
    mean_mm: float
    max_mm: float
    points: int


@dataclass
class Target:
    name: str
    position: np.ndarray
    rms_mm: float
    p95_mm: float
    bias_mm: float
    stated_mm: float


@dataclass
class Found:
    """What the report asks of a `registration.Registration`."""

    residuals: np.ndarray
    verdict: str = "pass"
    model_from_scanner: np.ndarray = field(default_factory=lambda: np.eye(4))
    reasons: list[str] = field(default_factory=lambda: ["all motions are held"])
    weak_directions: list[str] = field(default_factory=lambda: ["rotation about the axis of the socket"])
    rms_mm: float = 0.31
    mean_mm: float = 0.24
    max_mm: float = 1.4
    predicted_rotation_deg: float = 0.11
    stated_mm: float = float("inf")
    history: list[Entry] = field(
        default_factory=lambda: [
            Entry("coarse" if k < 5 else "fine", 3 * 0.7**k, 1.0, 9 * 0.8**k, 10) for k in range(12)
        ]
    )

    @property
    def inliers(self) -> np.ndarray:
        return np.abs(self.residuals) < 3

    @property
    def targets(self) -> list[Target]:
        return [Target("socket centre", np.zeros(3), 0.06, 0.11, float("inf"), self.stated_mm)]


def pulse(times_ps: np.ndarray, at_ps: float, height: float) -> np.ndarray:
    return height * np.exp(-(((times_ps - at_ps) / 260.0) ** 2))


def bowl_line(row: int, *, traces: bool = True) -> ScanLine:
    rng = np.random.default_rng([5, row])
    x, y = 3.0 * (np.arange(COLUMNS) - COLUMNS / 2), 3.0 * (row - ROWS / 2)
    z = 920.0 - (x**2 + y**2) / 50 + rng.normal(scale=0.3, size=COLUMNS)
    points = np.column_stack([x, np.full(COLUMNS, y), z])
    flags = np.zeros(COLUMNS, dtype=np.uint16)
    if row == 3:
        flags[4:6] = Flag.NO_ECHO
        points[4:6] = np.nan
    times = START_PS + STEP_PS * np.arange(SAMPLES)
    mv = np.array(
        [pulse(times, 7600, 50) + pulse(times, 7600 + (d - 620) / 0.1499, 40) for d in np.nan_to_num(z, nan=900)]
    )
    sums = np.round(8 * (40 + mv / 0.5) + rng.normal(scale=6, size=mv.shape)).clip(0, 2040).astype(np.uint16)
    return ScanLine(
        index=row,
        columns=np.arange(COLUMNS, dtype=np.int32),
        angles_rad=np.column_stack([x, np.full(COLUMNS, y)]) / 900,
        points_mm=points,
        covariance_mm2=np.tile(0.07 * np.eye(3), (COLUMNS, 1, 1)),
        range_mm=np.where(flags == 0, np.linalg.norm(points, axis=1), np.nan),
        range_variance_mm2=np.full(COLUMNS, 0.07),
        response_mv=rng.uniform(32, 58, COLUMNS),
        flags=flags,
        traces=Trace(sums, 8, times, CodeScale(40.0, 0.5)) if traces else None,
        sweeps=8,
        device_time_s=float(row),
    )


def scan(
    path: Path, *, rows: int = ROWS, traces: bool = True, verified: bool = True, reason: str = "complete"
) -> Recording:
    recording = Recording.create(path, HEADER)
    for row in range(rows):
        recording.append(bowl_line(row, traces=traces))
    recording.finish(reason, laser_off_verified=verified)
    return recording


def bowl_mesh() -> tuple[np.ndarray, np.ndarray]:
    side = np.linspace(-40, 40, 21)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    vertices = np.column_stack([x, y, 920.0 - (x**2 + y**2) / 50])
    at = np.arange(441).reshape(21, 21)
    corners = [at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]]
    a, b, c, d = (corner.ravel() for corner in corners)
    return vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([b, d, c])])


def report(folder: Path, recording: Recording, **kwargs: Any) -> tuple[str, Path]:
    registered = RegisteredScan(**{"tolerance": Tolerance(), **kwargs}) if kwargs else None
    summary = {"scan": {"device_time_s": 240.0}, "nan": np.nan}
    file = write_report(folder, recording=recording, registered=registered, summary=summary)
    recording.close()
    return file.read_text(encoding="utf-8"), folder


def residuals() -> np.ndarray:
    found = np.random.default_rng(2).normal(scale=0.4, size=ROWS * COLUMNS - 2)
    found[:6], found[6:8] = 2.0, -4.5
    return found


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    folder = tmp_path_factory.mktemp("report")
    vertices, faces = bowl_mesh()
    return report(
        folder,
        scan(folder / "scan.db"),
        registration=Found(residuals()),
        model=Surface(vertices, faces),
        truth_error={"rotation_deg": 0.1, "translation_mm": 0.2, "tre_mm": 0.083},
    )


def test_everything_is_in_the_folder(full: tuple[str, Path]) -> None:
    _, folder = full
    names = {entry.name for entry in folder.iterdir()}
    pictures = {"overlay.png", "residuals.png", "cloud.png", "waveform.png", "convergence.png"}
    assert names == pictures | {"scan.db", "report.html", "cloud.ply", "result.json"}
    assert all((folder / name).read_bytes().startswith(b"\x89PNG") for name in pictures)
    assert json.loads((folder / "result.json").read_text()) == {"nan": None, "scan": {"device_time_s": 240.0}}


def test_the_page_says_the_verdict_and_the_figures(full: tuple[str, Path]) -> None:
    page, _ = full
    assert "PASSED" in page
    assert "0.110&nbsp;mm" in page
    assert "0.083&nbsp;mm" in page
    assert "all motions are held" in page
    assert "no echo: 2" in page
    assert "yes, read back" in page
    assert page.count("<figure>") == 5


def test_the_page_asks_nobody_for_anything(full: tuple[str, Path]) -> None:
    page, _ = full
    sources = re.findall(r'(?:src|href|url)\s*[=(]\s*"?([^"\s)>]{0,30})', page)
    assert len(sources) == 5
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert "<script" not in page
    assert "default-src 'none'" in page


def test_the_same_data_give_the_same_pictures(full: tuple[str, Path], tmp_path: Path) -> None:
    vertices, faces = bowl_mesh()
    report(
        tmp_path,
        scan(tmp_path / "scan.db", traces=False),
        registration=Found(residuals(), history=[]),
        model=Surface(vertices, faces),
    )
    for name in ("overlay.png", "residuals.png", "cloud.png", "cloud.ply"):
        assert (tmp_path / name).read_bytes() == (full[1] / name).read_bytes()


def small(path: Path) -> Recording:
    return scan(path, rows=2, traces=False, reason="aborted")


def quick(**kwargs: Any) -> Found:
    return Found(np.zeros(2 * COLUMNS), history=[], **kwargs)


@pytest.mark.parametrize(("verdict", "word"), [("caution", "CAUTION"), ("fail", "FAILED")])
def test_other_verdicts(tmp_path: Path, verdict: str, word: str) -> None:
    page, _ = report(tmp_path, small(tmp_path / "scan.db"), registration=quick(verdict=verdict))
    assert word in page
    assert "PASSED" not in page
    assert not (tmp_path / "overlay.png").exists()


def test_a_pose_that_the_simulated_bench_knows_to_be_wrong(tmp_path: Path) -> None:
    truth = {"rotation_deg": 1.2, "translation_mm": 0.2, "tre_mm": 0.5}
    page, _ = report(tmp_path, small(tmp_path / "scan.db"), registration=quick(), truth_error=truth)
    assert page.index("SCAN NOT COMPLETE") < page.index("WRONG POSE") < page.index("PASSED")
    assert "above the tolerance of 1 degree or 1 mm" in page


@pytest.mark.parametrize(
    ("tolerance", "wrong"),
    [
        (Tolerance(1.3, 1.0), False),
        (Tolerance(1.1, 1.0), True),
        (Tolerance(2.0, 0.19), True),
        (Tolerance(1.2, 0.2), False),
    ],
)
def test_the_tolerance_decides_what_a_wrong_pose_is(tmp_path: Path, tolerance: Tolerance, wrong: bool) -> None:
    truth = {"rotation_deg": 1.2, "translation_mm": 0.2, "tre_mm": 0.5}
    recording = small(tmp_path / "scan.db")
    page, _ = report(tmp_path, recording, registration=quick(), truth_error=truth, tolerance=tolerance)
    said = f"above the tolerance of {tolerance.rotation_deg:g} degree or {tolerance.target_mm:g} mm"
    assert ("WRONG POSE" in page) is wrong
    assert (said in page) is wrong
    assert f"{tolerance.rotation_deg:g}° and {tolerance.target_mm:g} mm at the targets" in page
    assert "2 of 12 lines are there. Ended: aborted." in page


@pytest.mark.parametrize(
    ("verdict", "at_targets_mm", "stated_mm", "wrong"),
    [
        ("pass", 0.4, 0.5, False),
        ("pass", 0.6, 0.5, True),
        ("caution", 1.3, 1.4, False),  # beyond the tolerance of 1 mm, and said so
        ("caution", 1.3, 1.2, True),
        ("caution", 1.3, float("nan"), True),  # nothing was stated: the tolerance counts
        ("fail", 1.3, 1.4, True),
    ],
)
def test_what_is_stated_at_the_targets_decides_too(
    tmp_path: Path, verdict: str, at_targets_mm: float, stated_mm: float, wrong: bool
) -> None:
    truth = {"rotation_deg": 0.2, "translation_mm": at_targets_mm, "tre_mm": 0.5, "at_targets_mm": at_targets_mm}
    registration = quick(verdict=verdict, stated_mm=stated_mm)
    page, _ = report(tmp_path, small(tmp_path / "scan.db"), registration=registration, truth_error=truth)
    assert ("WRONG POSE" in page) is wrong
    assert ("stated at the targets" in page) is (at_targets_mm > stated_mm)


def test_scan_alone_without_traces(tmp_path: Path) -> None:
    page, _ = report(tmp_path, scan(tmp_path / "scan.db", traces=False))
    assert "SCAN COMPLETE" in page
    assert not (tmp_path / "waveform.png").exists()


def test_broken_off_scan_and_laser_not_verified(tmp_path: Path) -> None:
    page, _ = report(tmp_path, scan(tmp_path / "scan.db", rows=0, verified=False, reason="link lost <USB>"))
    assert "SCAN NOT COMPLETE" in page
    assert "LASER OFF NOT VERIFIED" in page
    assert "link lost &lt;USB&gt;" in page


def test_a_registration_of_other_points_is_refused(tmp_path: Path) -> None:
    recording = scan(tmp_path / "scan.db")
    registered = RegisteredScan(Found(np.zeros(3)), Tolerance())
    with pytest.raises(ValueError, match="has 3 points, the recording 166"):
        write_report(tmp_path, recording=recording, registered=registered, summary={})
    recording.close()


def test_classes_at_their_limits() -> None:
    assert classes_of(np.array([0.0, -1.0, 1.0001, 3.0, -3.0001])).tolist() == [0, 0, 1, 1, 2]


def test_time_significant_points_of_a_known_trace() -> None:
    times = START_PS + 6.7 * np.arange(1430)
    trace = pulse(times, 7600.0, 50) + pulse(times, 11_500.0, 20)
    (reference, level), (echo, _) = time_significant_points(times, trace)
    lead = 260.0 * np.sqrt(np.log(2))
    assert reference == pytest.approx(7600.0 - lead, abs=1.5)
    assert level == pytest.approx(25.0, rel=0.02)
    assert echo == pytest.approx(11_500.0 - lead, abs=1.5)
    assert time_significant_points(times, np.zeros_like(times)) == []


def test_two_echoes_have_a_line_and_a_picture_where_there_are_any(tmp_path: Path) -> None:
    page, folder = report(tmp_path / "one", scan(tmp_path / "one.db"))
    assert re.search(r"places with two echoes</th>\s*<td>none told apart<", page)
    assert not (folder / "two-echoes.png").exists()

    last = {"last_range_mm": np.full(COLUMNS, np.nan), "last_response_mv": np.full(COLUMNS, np.nan)}
    line = bowl_line(0, traces=False)
    last["last_range_mm"][[2, 7, 8]], last["last_response_mv"][[2, 7, 8]] = (
        line.range_mm[[2, 7, 8]] + [20, 30, 60],
        25.0,
    )
    recording = Recording.create(tmp_path / "two.db", HEADER)
    recording.append(replace(line, **last))
    recording.finish("complete", laser_off_verified=True)
    page, folder = report(tmp_path / "two", recording)
    assert f"3 of {COLUMNS}, 30.0 mm apart in the middle (20.0 mm to 60.0 mm)" in page
    assert (folder / "two-echoes.png").stat().st_size > 10_000
    assert "Places with two echoes" in page
