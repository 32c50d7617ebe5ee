"""Settings: what is refused, with what words, and that the commented file reads back to the same settings."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from picoradar.instrument.errors import BadInput
from picoradar.instrument.settings import Settings, load_settings, override, to_toml


def write(folder: Path, text: str) -> Path:
    path = folder / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_commented_file_reads_back_to_the_same_settings(tmp_path: Path) -> None:
    settings = override(Settings(), {"scan": {"rows": 12, "averages": 3}, "": {"calibration": 'a "quoted\\ name"'}})
    text = to_toml(settings)
    assert load_settings(write(tmp_path, text)) == settings
    assert "# pulse repetition frequency, Hz" in text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[pulser]\ndrive_v = 400\n", ["line 2", "pulser.drive_v", "400", "330"]),
        ("\n[scan]\nrows = 0\n", ["line 3", "scan.rows", "0", "greater than or equal to 1"]),
        ("[scan]\nrows = 4.5\n", ["scan.rows", "4.5", "integer"]),
        ("[scan]\nstep_mm = nan\n", ["scan.step_mm", "nan"]),
        ("[scan]\ncolour = 1\n", ["line 2", "scan.colour", "unknown key"]),
        ("[lidar]\nx = 1\n", ["line 1", "lidar", "unknown key"]),
        ("[pulser]\ndrive_v = 320\n", ["drive_v 320 V overheats", "300"]),
        ("[scan\nrows = 1\n", ["not valid TOML"]),
        ('[scan]\nmode = "fly"\n', ["scan.mode", "'fly'", "'sweep'"]),
        ("seed = -1\n", ["seed", "-1"]),
        ("seed = " + "9" * 5000, ["not valid TOML", "4300 digits"]),
        ("seed = 0x" + "f" * 30, ["not valid TOML", "more than 64 bits"]),
        ("[simulation]\nx = " + "[" * 5000 + "]" * 5000, ["not valid TOML", "nested too deeply"]),
        ('calibration = 5\nseed = "' + 5000 * "x" + '"\n', ["seed = 'xxxxx", "x...: "]),
        ('[links]\ndg645 = "spy:///dev/null?file=thesis.tex"\n', ["line 2", "links.dg645", "spy:// is not opened"]),
        ('[links]\ngenesys = "loop://"\n', ["links.genesys", "loop:// is not opened"]),
        ('[links]\ntec = "alt://COM1?class=X"\n', ["links.tec", "alt:// is not opened"]),
        ('[links]\ntc200 = "hwgrep://.*"\n', ["links.tc200", "hwgrep:// is not opened"]),
        ('[links]\nusb_backend = "usb.libloader:load_library"\n', ["links.usb_backend", "not a backend"]),
        ('[links]\nusb_address = "/tmp/evil.so"\n', ["links.usb_address", "not host:port"]),
    ],
)
def test_bad_settings_are_refused_with_file_place_value_and_range(
    tmp_path: Path, text: str, expected: list[str]
) -> None:
    path = write(tmp_path, text)
    with pytest.raises(BadInput) as refusal:
        load_settings(path)
    for part in [str(path), *expected]:
        assert part in str(refusal.value)


def test_a_missing_or_binary_file_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no-such-file"):
        load_settings(tmp_path / "no-such-file.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInput, match="binary"):
        load_settings(tmp_path / "binary.toml")


def test_options_override_and_are_checked_like_the_file() -> None:
    assert override(Settings(), {"scan": {"rows": 7, "columns": None}}).scan.rows == 7
    with pytest.raises(BadInput, match=r"scan\.averages = 999"):
        override(Settings(), {"scan": {"averages": 999}})


@given(
    drive_v=st.floats(allow_nan=True, allow_infinity=True),
    prf_hz=st.floats(allow_nan=True, allow_infinity=True),
)
def test_no_setting_ever_overheats_the_transmitter(drive_v: float, prf_hz: float) -> None:
    try:
        checked = override(Settings(), {"pulser": {"drive_v": drive_v, "prf_hz": prf_hz}}).pulser
    except BadInput:
        return
    assert 240 <= checked.drive_v <= 330
    assert 20_000 <= checked.prf_hz <= 240_000
    assert checked.drive_v <= 300 or checked.prf_hz < 80_000
