"""What all points of a scan share goes along with its exports: a file cannot pass where its recording does not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from picoradar.instrument.cli.main import run
from picoradar.instrument.files.export import export
from picoradar.instrument.files.points import PointFileError, read_points
from picoradar.instrument.recording import Recording
from picoradar.sim.physics import HIP_FILE
from tests.system.conftest import Told

SCAN = ("--grid", "20x20", "--step-mm", "2", "--mode", "window", "--seed", "7", "--material", "bone")
FORMATS = (".ply", ".csv", ".npz")
DRIFT_MM = 4.0  # of the reference fibre: all ranges are off by half of it


@pytest.fixture(scope="module")
def scanned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scanned") / "scan.db"
    assert run(["scan", *SCAN, "-o", str(path)]) == 0
    return path


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_point_file_is_registered_by_what_its_recording_knew(
    scanned: Path, tmp_path: Path, told: Told, suffix: str
) -> None:
    target = tmp_path / f"cloud{suffix}"
    told("export", scanned, "-o", target)
    recorded, exported = told("register", scanned, HIP_FILE), told("register", target, HIP_FILE)
    known = told("info", scanned)["range_error"]
    assert known["sd_mm"] > 0.05
    assert recorded["range_error"] == {**known, "source": "scan.db"}
    assert exported["range_error"] == {**known, "source": target.name}
    assert exported["zero_check"] == recorded["zero_check"]
    assert exported["verdict"] == recorded["verdict"] == "pass"
    for one, other in zip(exported["targets"], recorded["targets"], strict=True):
        assert one["bias_mm"] == pytest.approx(other["bias_mm"], rel=0.2)  # PLY and CSV have no covariances of points
    said = told("register", target, HIP_FILE, "--range-bias-mm", "0.3")
    assert said["range_error"] == {**known, "sd_mm": 0.3, "source": "--range-bias-mm"}


def test_the_parts_of_the_deviation_make_the_whole(scanned: Path, tmp_path: Path, told: Told) -> None:
    told("export", scanned, "-o", tmp_path / "cloud.npz")
    with np.load(tmp_path / "cloud.npz", allow_pickle=False) as archive:
        found = json.loads(str(archive["range_error"]))
    with Recording.open(scanned) as recording:
        calibration = recording.header["calibration"]
    entry = calibration["materials"]["bone"]["window"]
    assert found["range_zero_sd_mm"] == calibration["range_zero_sd_mm"]
    assert found["bias_sd_mm"] == pytest.approx(np.hypot(entry["sample_sd_mm"], entry["transfer_sd_mm"]))
    assert found["sd_mm"] == pytest.approx(np.hypot(found["range_zero_sd_mm"], found["bias_sd_mm"]))


def test_las_and_trees_carry_it_too(scanned: Path, tmp_path: Path, told: Told) -> None:
    laspy = pytest.importorskip("laspy", reason="needs the extra `formats`")
    h5py = pytest.importorskip("h5py", reason="needs the extra `formats`")
    info = told("info", scanned)
    for suffix in (".las", ".h5"):
        told("export", scanned, "-o", tmp_path / f"cloud{suffix}")
    (record,) = [vlr for vlr in laspy.read(tmp_path / "cloud.las").header.vlrs if vlr.user_id == "picoradar"]
    with h5py.File(tmp_path / "cloud.h5", "r") as root:
        tree = {name: json.loads(root.attrs[name]) for name in ("range_error", "zero_check")}
    assert json.loads(record.record_data) == tree
    assert tree["range_error"].items() >= info["range_error"].items()
    assert tree["zero_check"] == info["zero_check"]


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_failed_check_is_no_better_in_a_file(tmp_path: Path, told: Told, suffix: str) -> None:
    (tmp_path / "drifted.toml").write_text(f"[simulation]\nreference_path_mm = {1031.4 + DRIFT_MM}\n", encoding="utf-8")
    told("scan", "--settings", tmp_path / "drifted.toml", *SCAN, "-o", tmp_path / "scan.db")
    told("export", tmp_path / "scan.db", "-o", tmp_path / f"cloud{suffix}")
    found = told("register", tmp_path / f"cloud{suffix}", HIP_FILE, code=1)
    assert (found["verdict"], found["zero_check"]["outcome"]) == ("fail", "failed")
    assert found["reasons"][0].startswith("The mark of known range reads ")


def test_a_file_that_says_nothing_of_a_check_does_not_pass(scanned: Path, tmp_path: Path, told: Told) -> None:
    with Recording.open(scanned) as recording:
        export(recording, tmp_path / "cloud.ply")  # by a program that does not know how the check came out
    found = told("register", tmp_path / "cloud.ply", HIP_FILE)
    assert (found["verdict"], found["zero_check"]["outcome"]) == ("caution", "none")
    assert any("picoradar export" in reason for reason in found["reasons"])


def test_people_are_told_where_it_is_from(scanned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["export", str(scanned), "-o", str(tmp_path / "cloud.ply")]) == 0
    for arguments, words in (
        ([str(tmp_path / "cloud.ply")], "(cloud.ply); bone,"),
        ([str(scanned)], "(scan.db); bone,"),
        ([str(tmp_path / "cloud.ply"), "--range-bias-mm", "0.3"], "SD 0.300 mm (--range-bias-mm); bone,"),
    ):
        capsys.readouterr()
        assert run(["register", arguments[0], str(HIP_FILE), *arguments[1:]]) == 0
        assert words in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("range_error", '{"sd_mm": -1}', "range_error.sd_mm"),
        ("range_error", '{"sd_mm": "0.1"}', "range_error.sd_mm"),
        ("range_error", '{"bias_mm": null}', "range_error.bias_mm"),
        ("range_error", '{"material": 3}', "range_error.material"),
        ("range_error", "{broken}", "cloud"),
        ("zero_check", '{"outcome": "fine", "sentence": ""}', "none of passed, failed, none"),
        ("zero_check", '{"outcome": "passed"}', "no sentence"),
        ("zero_check", '{"outcome": "passed", "sentence": "", "limit_mm": "1"}', "limit_mm"),
    ],
)
@pytest.mark.parametrize("suffix", FORMATS)
def test_what_a_file_says_is_read_strictly(tmp_path: Path, suffix: str, name: str, content: str, words: str) -> None:
    path = tmp_path / f"cloud{suffix}"
    if suffix == ".npz":
        np.savez(path, points_mm=np.ones((1, 3)), **{name: np.array(content)})
    elif suffix == ".csv":
        path.write_text(f"x,y,z\n# picoradar {name} {content}\n1,1,1\n", encoding="ascii")
    else:
        header = f"ply\nformat ascii 1.0\ncomment picoradar {name} {content}\nelement vertex 1\n"
        axes = "".join(f"property double {axis}\n" for axis in "xyz")
        path.write_text(f"{header}{axes}end_header\n1 1 1\n", encoding="ascii")
    with pytest.raises(PointFileError, match=words):
        read_points(path)


def test_a_text_in_an_archive_is_one_text(tmp_path: Path) -> None:
    np.savez(tmp_path / "cloud.npz", points_mm=np.ones((1, 3)), range_error=np.zeros(3))
    with pytest.raises(PointFileError, match="make it one text"):
        read_points(tmp_path / "cloud.npz")
