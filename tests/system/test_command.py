"""The command's contract, called as other programs call it: JSON alone on stdout, exit status, refusals in one line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from picoradar.instrument.cli.main import run
from picoradar.instrument.recording import Recording

pytestmark = pytest.mark.timeout(180)  # whole demos, also on a busy machine

Called = tuple[int, dict[str, Any], str]


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]):
    def _call(*arguments: object) -> Called:
        capsys.readouterr()
        code = run([str(a) for a in arguments])
        out, err = capsys.readouterr()
        assert out.count("\n") == 1, f"stdout must hold one JSON object and nothing else: {out[:200]!r}"
        return code, json.loads(out), err

    return _call


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("demo") / "report"
    out = subprocess.run(
        [sys.executable, "-m", "picoradar.instrument.cli", "demo", "--seed", "3", "--out", str(folder), "--json"],
        capture_output=True, text=True, check=False, timeout=170,
    )  # fmt: skip
    assert out.returncode == 0, out.stderr
    return folder, json.loads(out.stdout)


def test_the_demo_finds_the_pose_and_says_so(demo: tuple[Path, dict[str, Any]]) -> None:
    _, result = demo
    assert result["truth_error"]["rotation_deg"] < 1.0
    assert result["truth_error"]["translation_mm"] < 1.0
    assert result["registration"]["verdict"] == "pass"
    assert result["scan"]["laser_off_verified"] is True
    assert result["scan"]["points"] >= 1590
    assert result["scan"]["shot_limited_s"] == pytest.approx(228.8)
    assert 228 <= result["scan"]["device_time_s"] <= 290
    assert 0.2 < result["scan"]["truth"]["range_rms_mm"] < 0.35


def test_the_report_folder_holds_what_is_promised(demo: tuple[Path, dict[str, Any]]) -> None:
    folder, result = demo
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "https://" not in page
    assert 'src="data:image/png;base64,' in page
    for name in ("waveform", "cloud", "overlay", "residuals", "convergence"):
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((folder / "result.json").read_text())["truth_error"] == result["truth_error"]
    assert len(trimesh.load(folder / "cloud.ply").vertices) == result["scan"]["points"]


def test_the_files_of_the_demo_can_be_used_by_the_other_commands(
    demo: tuple[Path, dict[str, Any]], call: Any, tmp_path: Path
) -> None:
    folder, result = demo
    code, info, _ = call("info", folder / "scan.db", "--json")
    assert (code, info["lines"], info["lines_ok"], info["complete"]) == (0, 40, 40, True)
    assert info["seed"] == 3
    for ending in ("ply", "csv", "npz"):
        code, exported, _ = call("export", folder / "scan.db", "-o", tmp_path / f"cloud.{ending}", "--json")
        assert (code, exported["points"]) == (0, result["scan"]["points"])
    pose = np.array(result["registration"]["model_from_scanner"])
    points = trimesh.load(folder / "cloud.ply").vertices
    # The table knows neither covariances nor neighbours, so its pose differs a little; the recording's may not.
    for cloud, allowed_mm in ((folder / "scan.db", 1e-6), (tmp_path / "cloud.csv", 0.5)):
        landmarks = ["--landmarks", folder / "landmarks.json"]
        code, registered, _ = call("register", cloud, folder / "model.stl", *landmarks, "--json")
        assert code == 0
        moved = np.array(registered["model_from_scanner"]) - pose
        assert np.linalg.norm(points @ moved[:3, :3].T + moved[:3, 3], axis=1).max() < allowed_mm
    code, scanned, _ = call(
        "scan", "--settings", folder / "settings.toml", "--grid", "2x3", "-o", tmp_path / "again.db", "--json"
    )
    assert (code, scanned["grid"], scanned["lines"]) == (0, [2, 3], 2)
    np.testing.assert_allclose(
        scanned["truth"]["model_from_scanner"], result["scan"]["truth"]["model_from_scanner"], atol=1e-12
    )


def test_the_tolerance_decides_the_verdict(call: Any, demo: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = demo
    given = ("register", folder / "scan.db", folder / "model.stl", "--landmarks", folder / "landmarks.json", "--json")
    found = {}
    for tolerance in (None, "1,1", "0.01,1", "1,0.01", "3,2"):
        code, result, _ = call(*given, *([] if tolerance is None else ["--tolerance", tolerance]))
        found[tolerance] = result
        assert result["verdict"] == ("fail" if code else "pass")
        assert bool(code) is (tolerance in ("0.01,1", "1,0.01"))
    assert found[None]["tolerance"] == found["1,1"]["tolerance"] == {"rotation_deg": 1.0, "target_mm": 1.0}
    assert "limit is 0.01 deg" in found["0.01,1"]["reasons"][0]
    assert "limit is 0.01 mm" in " ".join(found["1,0.01"]["reasons"])
    poses = [result["model_from_scanner"] for result in found.values()]
    assert all(pose == poses[0] for pose in poses)


@pytest.mark.parametrize("text", ["1", "1,2,3", "0,1", "1,-1", "nan,1", "a,b"])
def test_a_tolerance_that_makes_no_sense_is_refused(call: Any, demo: tuple[Path, dict[str, Any]], text: str) -> None:
    folder, _ = demo
    code, result, _ = call("register", folder / "scan.db", folder / "model.stl", f"--tolerance={text}", "--json")
    assert code == 2
    assert "--tolerance" in result["error"]


def test_the_demo_is_accepted_by_the_tolerance_asked_for(call: Any, tmp_path: Path) -> None:
    small = ("demo", "--grid", "14x14", "--step-mm", "3", "--json")
    found = {}
    for tolerance in ("2,2", "0.001,2"):
        folder = tmp_path / tolerance
        code, result, _ = call(*small, "--tolerance", tolerance, "--out", folder)
        found[tolerance] = code, result["registration"]["verdict"], (folder / "report.html").read_text(encoding="utf-8")
    assert found["2,2"][:2] == (0, "pass")
    assert found["0.001,2"][:2] == (1, "fail")
    assert "WRONG POSE" not in found["2,2"][2]
    assert "above the tolerance of 0.001 degree or 2 mm" in found["0.001,2"][2]


def test_same_seed_same_bytes_and_another_seed_other_bytes(call: Any, tmp_path: Path) -> None:
    def cloud(name: str, seed: int) -> bytes:
        code, *_ = call("scan", "--grid", "3x4", "--seed", seed, "-o", tmp_path / f"{name}.db", "--json")
        assert code == 0
        call("export", tmp_path / f"{name}.db", "-o", tmp_path / f"{name}.ply", "--json")
        return (tmp_path / f"{name}.ply").read_bytes()

    assert cloud("a", 5) == cloud("b", 5)
    assert cloud("c", 6) != cloud("d", 5)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["scan", "--grid", "40by40"], "ROWSxCOLUMNS"),
        (["scan", "--averages", "1000"], "scan.averages = 1000"),
        (["scan", "--target", "teapot"], "teapot"),
        (["scan", "--speed", "fast"], "--speed 'fast'"),
        (["scan", "--target-pose", "1,2,3"], "not 6 numbers"),
        (["scan", "--step-mm", "5", "--grid", "100x100"], "span"),
        (["scan", "--settings", "no-such.toml"], "no-such.toml"),
        (["info", "no-such.db"], "no-such.db"),
        (["register", "no-such.csv", "no-such.stl"], "no-such"),
        (["export", "no-such.db", "-o", "x.ply"], "no-such.db"),
        (["laser-class"], "--mean-power-mw"),
        (["nonsense"], "nonsense"),
        (["scan", "--no-such-option"], "--no-such-option"),
    ],
)
def test_bad_usage_is_status_2_and_one_line(
    arguments: list[str], expected: str, call: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, result, err = call(*arguments, "--json")
    assert code == 2
    assert expected in result["error"]
    assert err.startswith("picoradar: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err


def test_a_recording_is_never_written_over(call: Any, tmp_path: Path) -> None:
    path = tmp_path / "scan.db"
    path.write_bytes(b"precious")
    code, result, _ = call("scan", "--grid", "1x1", "-o", path, "--json")
    assert code == 2
    assert "exists already" in result["error"]
    assert path.read_bytes() == b"precious"


def mesh_file(folder: Path, name: str, vertices: np.ndarray) -> Path:
    path = folder / name
    faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])
    points = "".join(f"{x} {y} {z}\n" for x, y, z in vertices)
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    path.write_text(head + "element face 4\nproperty list uchar int vertex_indices\nend_header\n" + points + faces)
    return path


TETRAHEDRON = np.array([[0, 0, 0], [50, 0, 0], [0, 50, 0], [0, 0, 50.0]])


def test_models_that_cannot_be_used_are_refused_with_the_finding(call: Any, tmp_path: Path) -> None:
    points = tmp_path / "points.csv"
    np.savetxt(points, np.random.default_rng(1).normal(0, 20, (50, 3)), delimiter=",")
    bad = TETRAHEDRON.copy()
    bad[2, 1] = np.nan
    (tmp_path / "empty.stl").write_bytes(b"")
    (tmp_path / "text.stl").write_text("not a mesh at all")
    for path, finding in (
        (mesh_file(tmp_path, "nan.ply", bad), "NaN"),
        (mesh_file(tmp_path, "metres.ply", TETRAHEDRON / 1000), "metres"),
        (tmp_path / "empty.stl", "empty"),
        (tmp_path / "text.stl", "mesh"),
    ):
        code, result, _ = call("register", points, path, "--json")
        assert code == 2, result
        assert path.name in result["error"]
        assert finding in result["error"]


@pytest.mark.parametrize(
    ("content", "finding"),
    [
        ("1,2,3\n4,5,6\n7,8,9\n", "6"),
        ("".join(f"{i},{2 * i},{3 * i}\n" for i in range(20)), "line"),
        ("1,2\n3,4\n", "column"),
        ("", "empty"),
    ],
)
def test_clouds_that_cannot_be_used_are_refused(call: Any, tmp_path: Path, content: str, finding: str) -> None:
    cloud = tmp_path / "cloud.csv"
    cloud.write_text(content)
    model = mesh_file(tmp_path, "model.ply", TETRAHEDRON)
    code, result, _ = call("register", cloud, model, "--json")
    assert code == 2, result
    assert finding in result["error"]


def test_help_has_an_example_for_each_command(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("demo", "scan", "info", "export", "register", "laser-class"):
        assert run([command, "--help"]) == 0
        assert "Example" in capsys.readouterr().out


def test_a_recording_is_ranged_again_with_another_estimator(call: Any, tmp_path: Path) -> None:
    first, second = tmp_path / "first.db", tmp_path / "second.db"
    call("scan", "--grid", "4x20", "-o", first, "--json")
    before = first.read_bytes()
    code, result, _ = call("reprocess", first, "-o", second, "--estimator", "template", "--json")
    assert (code, result["lines_ok"], result["raster"]["estimator"]) == (0, 4, "template")
    assert first.read_bytes() == before
    with Recording.open(first) as old, Recording.open(second) as new:
        half, template = old.cloud(), new.cloud()
    # The template fit uses all samples of the edges: its scatter about the same surface is several times smaller.
    assert np.median(template.range_variance_mm2) < np.median(half.range_variance_mm2) / 9
    assert abs(np.mean(template.range_mm - half.range_mm)) < 0.1


def test_a_scan_in_windows_is_ranged_again_to_the_same_bytes(call: Any, tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("w.db", "x.db")]
    call("scan", "--grid", "3x20", "--mode", "window", "-o", paths[0], "--json")
    code, result, _ = call("reprocess", paths[0], "-o", paths[1], "--json")
    assert (code, result["lines_ok"], result["raster"]["estimator"]) == (0, 3, "template")
    clouds = []
    for path in paths:
        with Recording.open(path) as recording:
            clouds.append(recording.cloud())
    for name in ("points_mm", "covariance_mm2", "range_mm", "range_variance_mm2", "response_mv", "flags"):
        assert np.array_equal(getattr(clouds[0], name), getattr(clouds[1], name), equal_nan=True), name
    code, result, _ = call("reprocess", paths[0], "-o", tmp_path / "y.db", "--estimator", "half-maximum", "--json")
    assert code == 2
    assert "half-maximum needs whole traces" in result["error"]


def test_only_recordings_with_samples_can_be_ranged_again(call: Any, tmp_path: Path) -> None:
    settings = tmp_path / "settings.toml"
    settings.write_text("[scan]\nkeep_traces = false\n", encoding="utf-8")
    for mode in ("sweep", "window"):
        path = tmp_path / f"{mode}.db"
        call("scan", "--settings", settings, "--grid", "1x3", "--mode", mode, "-o", path, "--json")
        code, result, _ = call("rerange", path, "-o", tmp_path / f"{mode}2.db", "--estimator", "template", "--json")
        assert code == 2
        assert "no raw samples" in result["error"]
