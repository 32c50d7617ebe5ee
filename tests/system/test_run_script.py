"""The start script: it needs only the standard library, says what is missing, and leaves no half-made environment."""

from __future__ import annotations

import ast
import importlib.machinery
import importlib.util
import platform
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script as a module, with a clone of its own in a temporary folder."""
    loader = importlib.machinery.SourceFileLoader("run_script", str(ROOT / "run"))
    spec = importlib.util.spec_from_loader("run_script", loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    loader.exec_module(module)
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    venv = tmp_path / ".venv"
    for name, value in {
        "HERE": tmp_path,
        "VENV": venv,
        "PYTHON": venv / "bin" / "python",
        "STAMP": venv / "picoradar-setup-done",
    }.items():
        monkeypatch.setattr(module, name, value)
    monkeypatch.setattr(module.shutil, "which", lambda _name: None)  # no uv
    return module


def half_made(script: ModuleType, failing: str):
    """A stand-in for running one step of the set-up, of which the one that mentions ``failing`` fails half-way."""
    called: list[str] = []

    def call(command: list[object], env: dict[str, str]) -> int:
        line = " ".join(map(str, command))
        called.append(line)
        script.PYTHON.parent.mkdir(parents=True, exist_ok=True)
        script.PYTHON.write_text("")
        return 1 if failing and failing in line else 0

    return call, called


@pytest.mark.parametrize(
    ("failing", "remedy"),
    [("-m venv", "python3-venv"), ("import pip", "python3-pip"), ("pip install", "connection to the package index")],
)
def test_what_is_missing_is_named_and_nothing_half_made_stays(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], failing: str, remedy: str
) -> None:
    call, _ = half_made(script, failing)
    monkeypatch.setattr(script, "call", call)
    with pytest.raises(SystemExit) as end:
        script.set_up()
    assert end.value.code == 2
    out, err = capsys.readouterr()
    assert remedy in err
    assert out == ""
    assert not script.VENV.exists()


def test_the_second_call_sets_nothing_up_until_the_needs_change(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    call, called = half_made(script, "")
    monkeypatch.setattr(script, "call", call)
    script.set_up()
    first = len(called)
    assert first > 0
    script.set_up()
    assert len(called) == first
    (script.HERE / "pyproject.toml").write_text("[project]\nname = 'other'\n")
    script.set_up()
    assert len(called) == 2 * first


def locked_for(script: ModuleType, system: str) -> None:
    lock = script.HERE / script.LOCK
    lock.parent.mkdir(exist_ok=True)
    lock.write_text(f"# Written by ./run lock; resolved for: {system}\nsix==1.17.0\n")


def this_system() -> str:
    version = f"{sys.version_info[0]}.{sys.version_info[1]}"
    return f"{platform.python_implementation()} {version} {sys.platform} {platform.machine()}"


def test_locked_versions_are_installed_with_their_hashes_checked(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    locked_for(script, this_system())
    call, called = half_made(script, "")
    monkeypatch.setattr(script, "call", call)
    monkeypatch.setattr(script, "call_and_read", lambda command, env: (call(command, env), ""))
    script.set_up()
    assert f"--require-hashes -r {script.HERE / script.LOCK}" in called[-2]
    assert called[-1].endswith("--no-deps --no-build-isolation -e .")
    assert "locked" not in capsys.readouterr().err
    first = len(called)
    locked_for(script, this_system() + " ")  # another lock
    script.set_up()
    assert len(called) == 2 * first


@pytest.mark.parametrize("why", ["another system", "cannot be had"])
def test_without_locked_versions_the_ranges_are_taken_and_that_is_said(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], why: str
) -> None:
    locked_for(script, this_system() if why == "cannot be had" else "CPython 3.99 plan9 mips")
    call, called = half_made(script, "")
    monkeypatch.setattr(script, "call", call)
    monkeypatch.setattr(script, "call_and_read", lambda _command, _env: (1, "ERROR: No matching distribution"))
    script.set_up()
    assert called[-1].endswith("-e .[dev]")
    err = capsys.readouterr().err
    assert "versions not locked" in err
    assert why in err


def test_a_package_that_is_not_the_locked_one_is_refused(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    locked_for(script, this_system())
    call, called = half_made(script, "")
    words = "ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE."
    monkeypatch.setattr(script, "call", call)
    monkeypatch.setattr(script, "call_and_read", lambda _command, _env: (1, words))
    with pytest.raises(SystemExit):
        script.set_up()
    assert "find out why" in capsys.readouterr().err
    assert not any(".[dev]" in line for line in called)
    assert not script.VENV.exists()


def test_an_old_python_is_told_what_to_install(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(script.sys, "version_info", (3, 9, 2))
    with pytest.raises(SystemExit):
        script.suitable_python()
    assert "Python 3.11 or later is needed" in capsys.readouterr().err


def test_the_environment_of_the_caller_does_not_leak_in(script: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "/somewhere")
    monkeypatch.setenv("PIP_USER", "1")
    assert not {"PYTHONPATH", "PIP_USER"} & set(script.clean_environment())


def test_the_script_needs_the_standard_library_only() -> None:
    tree = ast.parse((ROOT / "run").read_text(encoding="utf-8"), feature_version=(3, 8))
    names = {a.name.split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    names |= {str(n.module).split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert names <= sys.stdlib_module_names
