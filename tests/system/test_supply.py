"""Locked versions, and the audit of them: silence that proves nothing is not taken for a clean bill."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
BAD = {"id": "PYSEC-1", "aliases": ["CVE-1"], "fix_versions": ["9.9"]}


def locked() -> dict[str, str]:
    text = (ROOT / "requirements" / "dev.txt").read_text(encoding="utf-8")
    rows = re.findall(r"^([\w.-]+)==(\S+).*?\\\n(?=    --hash=sha256:[0-9a-f]{64})", text, re.MULTILINE)
    return {canonicalize_name(name): version for name, version in rows}


def test_every_need_of_the_project_is_locked_within_its_range() -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    needs = [
        *PROJECT["project"]["dependencies"],
        *extras["formats"],
        *extras["dev"],
        *PROJECT["build-system"]["requires"],
    ]
    for need in map(Requirement, needs):
        if need.name != "picoradar":
            assert need.specifier.contains(locked()[canonicalize_name(need.name)]), f"{need}: ./run lock"


@pytest.mark.parametrize("name", ["dev.txt", "tools.txt"])
def test_the_locks_name_no_address_and_no_folder(name: str) -> None:
    lines = (ROOT / "requirements" / name).read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# Written by ./run lock; resolved for: CPython 3.")
    for line in lines[1:]:
        assert "://" not in line, line
        assert re.fullmatch(r"#.*|\s*|[\w.-]+==[^/@]+\\|    --hash=sha256:[0-9a-f]{64}( \\)?", line), line


@pytest.fixture
def supply(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[dict[str, list[object]] | None], ModuleType]:
    """The script with stand-ins for its tools: what the database knows, by version; None when it cannot be asked."""
    spec = importlib.util.spec_from_file_location("supply_script", ROOT / "requirements" / "supply.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "TOOLS", tmp_path)
    monkeypatch.setattr(module, "CANARY", tmp_path / "canary.txt")
    monkeypatch.setattr(module, "tools_there", lambda: True)

    def make(known: dict[str, list[object]] | None) -> ModuleType:
        def run(step: list[str], **_options: object) -> subprocess.CompletedProcess[str]:
            asked = Path(step[step.index("--requirement") + 1]).read_text(encoding="utf-8")
            if known is not None:
                pins = re.findall(r"^([\w.-]+)==(\S+)", asked, re.MULTILINE)
                rows = [{"name": n, "version": v, "vulns": known.get(f"{n}=={v}", [])} for n, v in pins]
                Path(step[step.index("--output") + 1]).write_text(json.dumps({"dependencies": rows}))
            return subprocess.CompletedProcess(step, 0 if known is not None else 1, stderr="no route to host\n")

        monkeypatch.setattr(module.subprocess, "run", run)
        return module

    return make


def test_a_known_vulnerability_fails_the_audit(supply, capsys: pytest.CaptureFixture[str]) -> None:
    numpy = f"numpy=={locked()['numpy']}"
    assert supply({"pyyaml==5.3": [BAD], numpy: [BAD]}).audit() == 1
    said = capsys.readouterr().err
    assert f"{numpy.replace('==', ' ')}: PYSEC-1 (CVE-1); mended in: 9.9" in said
    assert "1 known vulnerabilities" in said


def test_a_clean_audit_says_how_many_it_asked_about(supply, capsys: pytest.CaptureFixture[str]) -> None:
    assert supply({"pyyaml==5.3": [BAD]}).audit() == 0
    assert f"{len(locked())} packages, 0 known" in capsys.readouterr().err


@pytest.mark.parametrize(("known", "why"), [(None, "no route to host"), ({}, "knows nothing against pyyaml==5.3")])
def test_an_audit_that_proves_nothing_is_skipped_with_a_loud_word(supply, capsys, known, why: str) -> None:
    assert supply(known).audit() == 0
    said = capsys.readouterr().err
    assert "AUDIT SKIPPED" in said
    assert why in said
