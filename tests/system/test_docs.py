"""What README and guide show is what runs."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from picoradar.instrument.cli.main import run

pytestmark = pytest.mark.timeout(240)  # every command that is shown, also on a busy machine
ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(name: str, language: str) -> list[str]:
    return [body for kind, body in BLOCK.findall((ROOT / name).read_text(encoding="utf-8")) if kind == language]


def commands(name: str) -> list[list[str]]:
    """Lines of the shell blocks that call the command, or write a file by echo, in order, without comments."""
    lines = [line for block in blocks(name, "sh") for line in block.splitlines()]
    parts = [shlex.split(line, comments=True) for line in lines if line.startswith(("picoradar ", "./run ", "echo "))]
    called = [p if p[0] == "echo" else p[1:] for p in parts]
    return [p for p in called if p not in (["demo"], ["test"], ["check"])]


def test_the_commands_shown_work_one_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    done: list[list[str]] = []
    for arguments in commands("README.md") + commands("docs/guide.md"):
        if arguments[0] == "echo":
            _, text, _, file = arguments
            Path(file).write_text(text, encoding="utf-8")
        elif arguments not in done:  # the guide begins with the README's demo
            assert run(arguments) == 0, f"{arguments}: {capsys.readouterr().err}"
            done.append(arguments)
    assert len(done) >= 8


def test_the_python_of_the_guide_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shown = blocks("docs/guide.md", "python")
    assert shown
    for block in shown:
        exec(compile(block, "docs/guide.md", "exec"), {"__name__": "guide"})


def test_every_relative_link_of_the_documents_leads_somewhere() -> None:
    missing = [
        f"{page.relative_to(ROOT)}: {target}"
        for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
        for target in re.findall(r"\]\((?!https?:)([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
        if not (page.parent / target).exists()
    ]
    assert not missing
