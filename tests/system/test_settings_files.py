"""The settings profiles and the schema: what a person starts from, and what an editor checks against."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

from picoradar.instrument.cli.commands.settings import settings_schema
from picoradar.instrument.cli.main import run
from picoradar.instrument.settings import Settings, load_settings
from picoradar.instrument.settings.profiles import PROFILES

SCHEMA = Path(__file__).parents[2] / "docs" / "settings.schema.json"


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert run(["settings", *arguments]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("profile", PROFILES)
def test_a_printed_profile_is_a_settings_file(profile: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    short, every = tmp_path / "short.toml", tmp_path / "every.toml"
    short.write_text(printed(capsys, profile), encoding="utf-8")
    every.write_text(printed(capsys, profile, "--all"), encoding="utf-8")
    settings = load_settings(short)
    assert settings.bench == "simulated"  # works before anything is edited
    written_out = load_settings(every)
    assert written_out.model_copy(update={"simulation": {}}) == settings.model_copy(update={"simulation": {}})
    assert settings.simulation.items() <= written_out.simulation.items()
    assert json.loads(printed(capsys, profile, "--json"))["settings"] == settings.model_dump(mode="json")


@pytest.mark.parametrize("profile", PROFILES)
def test_every_line_of_a_profile_that_may_need_thought_has_a_comment(
    profile: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text = printed(capsys, profile)
    assert text.startswith(f'# Profile "{profile}"')
    assert text.count("#") > 10


def test_a_laboratory_has_to_edit_the_links_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "bench").replace('bench = "simulated"', 'bench = "devices"')
    for name in ("dg645", "genesys", "tec"):
        assert f"# {name} = " in text
        text = text.replace(f"# {name} = ", f"{name} = ")
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    links = load_settings(path).links
    assert all("/dev/serial/by-id/" in url for url in (links.dg645, links.genesys, links.tec))


def test_a_profile_that_does_not_exist_is_refused_with_those_that_do(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["settings", "moon"]) == 2
    assert "bench, gray-target, operating-room" in capsys.readouterr().err


def test_the_schema_in_the_docs_is_up_to_date() -> None:
    assert json.loads(SCHEMA.read_text()) == json.loads(json.dumps(settings_schema())), (
        "settings have changed; write the schema anew: picoradar settings --schema > docs/settings.schema.json"
    )


def test_the_schema_knows_every_key_and_refuses_others() -> None:
    schema = settings_schema()
    assert schema["properties"].keys() == Settings.model_fields.keys()
    assert schema["additionalProperties"] is False
    assert schema["properties"]["simulation"]["properties"]["target"]["default"] == "hip"
    for name, table in Settings().model_dump().items():
        if isinstance(table, dict) and table:
            reference = schema["properties"][name]["$ref"].removeprefix("#/$defs/")
            assert schema["$defs"][reference]["properties"].keys() == table.keys()


def test_a_speed_on_real_devices_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "fast.toml"
    path.write_text('bench = "devices"\n[links]\nspeed = 20.0\n')
    assert run(["doctor", "--settings", str(path)]) == 2
    assert "real devices run at speed 1" in capsys.readouterr().err


def test_profiles_are_plain_toml() -> None:
    folder = Path(__file__).parents[2] / "instrument" / "settings" / "profiles"
    assert {path.stem for path in folder.glob("*.toml")} == set(PROFILES)
    for path in folder.glob("*.toml"):
        assert "links" in tomllib.loads(path.read_text(encoding="utf-8"))
