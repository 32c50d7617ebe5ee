"""The range error on a material: in the calibration file, in a recording's header, and taken off the ranges."""

from __future__ import annotations

import datetime
import json
import math
from pathlib import Path

import numpy as np
import pytest

from picoradar.instrument.calibration import Calibration, Material
from picoradar.instrument.errors import BadInput
from picoradar.instrument.files.points import read_points
from picoradar.instrument.recording import Recording, RecordingError
from picoradar.instrument.settings import Settings, override

DAY = datetime.datetime(2026, 1, 31, 12, tzinfo=datetime.UTC)
BONE = {"bias_mm": 3.0, "sample_sd_mm": 0.12, "transfer_sd_mm": 0.35, "measured": DAY, "method": "half painted piece"}
OLD = {"date": DAY, "provenance": "gray target", "mirror_separation_mm": 30.0, "range_zero_mm": 425.0}


def calibration(**changes: object) -> Calibration:
    return Calibration.model_validate({**OLD, **changes})


MEASURED = calibration(range_zero_sd_mm=0.1, materials={"bone": {"window": BONE}})


def test_a_file_from_before_keeps_its_digest_and_its_content() -> None:
    """Known value: the digest that this content had before there were materials."""
    before = calibration()
    assert before.digest == "sha256:ca051ca49462ccce64571c98e74d7dba510fb78f07ff73e08066b4657bc9699d"
    assert not {"materials", "range_zero_sd_mm"} & set(before.content())
    assert calibration(range_zero_sd_mm=0.1).digest != before.digest
    assert MEASURED.digest != calibration(range_zero_sd_mm=0.1).digest


def test_a_material_survives_the_file(tmp_path: Path) -> None:
    MEASURED.save(tmp_path / "cal.json")
    assert Calibration.load(tmp_path / "cal.json") == MEASURED
    assert json.loads((tmp_path / "cal.json").read_text())["materials"]["bone"]["window"]["bias_mm"] == 3.0


def test_the_bias_is_taken_off_in_the_way_it_was_measured_and_in_no_other() -> None:
    assert MEASURED.for_material("bone", "window").range_zero_mm == 422.0
    for material, ranging in (("bone", "template"), ("cartilage", "window"), ("", "window"), ("paint", "window")):
        assert MEASURED.for_material(material, ranging) is MEASURED  # type: ignore[arg-type]


def test_what_is_left_adds_zero_piece_and_carrying_over() -> None:
    known = MEASURED.range_error("bone", "window")
    assert known == ("bone", 3.0, pytest.approx(math.sqrt(0.1**2 + 0.12**2 + 0.35**2)))
    assert MEASURED.range_error("paint", "half-maximum") == ("paint", 0.0, 0.1)


@pytest.mark.parametrize(
    ("known", "material"),
    [
        (MEASURED, "cartilage"),
        (MEASURED, ""),
        (calibration(), "paint"),
        (calibration(materials=MEASURED.materials), "bone"),
    ],
    ids=["another material", "nobody said", "zero unknown, paint", "zero unknown, bone"],
)
def test_what_was_never_measured_has_no_deviation(known: Calibration, material: str) -> None:
    assert known.range_error(material, "window").sd_mm is None


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        (BONE | {"sample_sd_mm": -0.1}, "sample_sd_mm"),
        (BONE | {"bias_mm": float("nan")}, "bias_mm"),
        (BONE | {"measured": "2026-01-31T12:00:00"}, "time zone"),
        (BONE | {"method": ""}, "method"),
        ({"bias_mm": 3.0}, "sample_sd_mm"),
    ],
)
def test_an_entry_that_cannot_be_is_refused(entry: dict[str, object], said: str) -> None:
    table = {**calibration().content(), "materials": {"bone": {"window": entry}}}
    with pytest.raises(BadInput, match=said):
        Calibration.from_json(json.dumps(table, default=str), "file")


@pytest.mark.parametrize("name", ["Bone", "bone\n", "a" * 41, "<b>"])
def test_a_material_has_a_plain_name(name: str) -> None:
    with pytest.raises(BadInput, match="material"):
        override(Settings(), {"scan": {"material": name}})
    assert override(Settings(), {"scan": {"material": "bone"}}).scan.material == "bone"


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ({"material": 3}, "material"),
        ({"material": "bone", "bias_mm": "3"}, "bias_mm"),
        ({"material": "bone", "bias_mm": 3.0, "sd_mm": -1.0}, "sd_mm"),
        ([1], "range_error"),
    ],
)
def test_a_header_that_cannot_be_is_refused(tmp_path: Path, known: object, said: str) -> None:
    with pytest.raises(RecordingError, match=said):
        Recording.create(tmp_path / "scan.db", {"raster": {"rows": 1, "columns": 1}, "range_error": known})


@pytest.mark.parametrize(("known", "sd_mm"), [({"material": "bone", "bias_mm": 3.0, "sd_mm": 0.4}, 0.4), (None, None)])
def test_points_of_a_recording_carry_what_is_left(tmp_path: Path, known: object, sd_mm: float | None) -> None:
    header = {"raster": {"rows": 1, "columns": 1}} | ({} if known is None else {"range_error": known})
    with Recording.create(tmp_path / "scan.db", header) as recording:
        recording.finish("complete", laser_off_verified=True)
    assert read_points(tmp_path / "scan.db").range_bias_mm == sd_mm


def test_a_material_is_one_value_of_its_kind() -> None:
    assert np.isfinite(Material.model_validate(BONE).bias_mm)
