"""Half painted pieces scanned as bone: the form of the echoes tells what lies where, and how far it differs.

With the calibration that ships, whose `bench penetration` was done on another sample of bone, on another bench.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from picoradar.instrument.cli.main import run
from picoradar.instrument.cli.scanning import record_scan
from picoradar.instrument.cli.session import session
from picoradar.instrument.line import Flag
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Settings, override
from picoradar.sim.physics.targets import HIP_FILE

ROWS, COLUMNS = 13, 29


@pytest.fixture(params=["bone", "cancellous", "fat"], scope="module")
def scanned(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    """Errors (N,) before and after the correction, columns left of and right of the edge, and what was stated."""
    path = tmp_path_factory.mktemp("stretch") / "scan.db"
    material = str(request.param)
    settings = override(
        Settings(),
        {
            "": {"seed": 71},
            "scan": {
                "rows": ROWS,
                "columns": COLUMNS,
                "step_mm": 1.2,
                "averages": 8,
                "mode": "sweep",
                "estimator": "template",
                "material": "bone",
            },
            "simulation": {
                "world": "clinic",
                "tissue_sample": 72,
                "sample_material": material,
                "target": "coated",
            },
        },
    )
    with session(settings, None) as run:
        run.controller.warm_up()
        described, _, cloud = record_scan(run, path)
        assert run.simulated is not None
        runs = cloud.rows.astype(np.int64) * COLUMNS + cloud.columns + 1
        true_mm = run.simulated.bench.truth.ranges_mm(runs)
    with Recording.open(path) as recording:
        before = np.concatenate([line.range_mm for line in recording.lines(traces=False)])
        assert recording.range_error == described["range_error"]
    across_mm = np.tan(cloud.angles_rad[:, 0]) * 900.0
    return {
        "material": material,
        "before": before - true_mm,
        "after": cloud.range_mm - true_mm,
        "painted": across_mm < -4.0,
        "bare": across_mm > 4.0,
        "variance": cloud.range_variance_mm2,
        "flags": cloud.flags,
        "range_error": described["range_error"],
    }


def test_both_halves_are_right_within_what_is_stated(scanned: dict[str, np.ndarray]) -> None:
    sd_mm = scanned["range_error"]["sd_mm"]
    bare, painted = (float(np.nanmean(scanned["after"][scanned[half]])) for half in ("bare", "painted"))
    assert abs(bare) < 2.0 * sd_mm
    assert abs(painted) < 2.0 * sd_mm
    assert sd_mm < 0.35


def test_the_correction_gains_most_where_the_tissue_is_another(scanned: dict[str, np.ndarray]) -> None:
    rms = {
        name: {half: float(np.sqrt(np.nanmean(scanned[name][scanned[half]]) ** 2)) for half in ("bare", "painted")}
        for name in ("before", "after")
    }
    assert rms["before"]["painted"] > 2.5
    assert rms["after"]["painted"] < rms["before"]["painted"] / 8
    if scanned["material"] == "cancellous":
        assert rms["after"]["bare"] < rms["before"]["bare"] / 3


def test_tissue_is_not_taken_for_two_surfaces(scanned: dict[str, np.ndarray]) -> None:
    """As paint is calibrated, half of it is. (`distorted` may be there: the pulse of this bench is not quite that of
    the calibration, which painted halves show as well.) Fat stretches an echo so much that more than the pattern is
    left, and that is noticed."""
    mixed = (scanned["flags"] & np.uint16(Flag.MIXED)) != 0
    assert mixed[scanned["bare"]].mean() < (0.5 if scanned["material"] == "fat" else 0.1)
    assert mixed[scanned["painted"]].mean() < 0.05


@pytest.mark.slow
def test_a_scan_registered_at_its_end_states_the_range_error_that_is_left(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "clinic.toml").write_text('[simulation]\nworld = "clinic"\n', encoding="utf-8")
    raster = ["--grid", "26x26", "--step-mm", "1.5", "--mode", "window", "--material", "bone"]
    scan = ["scan", "--settings", str(tmp_path / "clinic.toml"), *raster, "--register", str(HIP_FILE)]
    assert run([*scan, "-o", str(tmp_path / "scan.db"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert run(["register", str(tmp_path / "scan.db"), str(HIP_FILE), "--json"]) == 0
    alone = json.loads(capsys.readouterr().out)
    assert found["range_error"]["sd_mm"] == pytest.approx(alone["range_error"]["sd_mm"])
    assert found["range_error"]["sd_mm"] < 0.3  # 0.4 before the scan
    for key in ("model_from_scanner", "verdict", "reasons"):
        assert found["registration"][key] == alone[key], key
    bias = [[target["bias_mm"] for target in one["targets"]] for one in (found["registration"], alone)]
    assert bias[0] == bias[1]
