"""``picoradar register`` says what is wrong with the files beside the cloud before it begins, naming the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from picoradar.instrument.cli.main import run


@pytest.mark.parametrize(
    ("option", "content", "finding"),
    [
        ("--targets", '[{"name": "rim"}]', "position"),
        ("--targets", '[{"name": "rim", "position": [0, NaN, 1]}]', "rim is at"),
        ("--targets", "[" * 200_000, "nested too deeply"),
        ("--targets", f'[{{"name": "rim", "position": [0, {"9" * 5000}, 1]}}]', "4300 digits"),
        ("--targets", '[{"name": "rim", "position": [{}, 0, 1]}]', "a target is a dict"),
        ("--exclude", "[" * 40 + "]" * 40, "nested deeper than 32"),
        ("--landmarks", "[{}, null]", "JSON list of objects"),
        ("--landmarks", '[{"scanner": [0, NaN, 1], "model": [0, 0, 0]}]', "finite"),
        ("--start", "[[1e999, 0, 0, 0]]", "neither a 4x4 matrix"),
        ("--start", str(2**80), "more than 64 bits"),
        ("--targets", '{"position": [0, 0, 0]}', "JSON list of objects"),
        ("--exclude", '[{"center": [0, 0], "radius_mm": 3}]', "excluded region 0"),
        ("--landmarks", '[{"scanner": [0, 0, 1]}]', "model"),
        ("--start", '{"towards": [0, 0, 1]}', "half_angle_deg"),
        ("--start", '{"towards": [0, 0, 0], "half_angle_deg": 10}', "no direction"),
        ("--budget", '{"mirror_size": 0.1}', "no entry 'mirror_size'"),
        ("--budget", '{"model_offset_mm": -0.5}', "model_offset_mm is -0.5"),
        ("--budget", '{"model_scale": "large"}', "model_scale is 'large'"),
        ("--budget", '{"walk_mm": null}', "walk_mm is None"),
        ("--budget", "[0.5]", "an error budget is an object"),
        ("--start", '{"half_angle_deg": 10}', "neither a 4x4 matrix nor a cone"),
    ],
)
def test_a_bad_file_is_named_before_the_cloud_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str, content: str, finding: str
) -> None:
    file = tmp_path / "places.json"
    file.write_text(content, encoding="utf-8")
    cloud = tmp_path / "there-is-no-cloud.csv"
    code = run(["register", str(cloud), str(tmp_path / "nor-a-model.stl"), option, str(file)])
    message = capsys.readouterr().err
    assert code == 2
    assert f"{option} {file}" in message
    assert finding in message
    assert str(cloud) not in message
