"""One installed package, that other people's folders do not disturb, with types and a short front for notebooks."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy
import pytest

import picoradar
from picoradar.instrument.settings import Links

ROOT = Path(__file__).parents[2]
FOLDERS = ("drivers", "registration", "sim", "instrument")

USER_PROGRAM = '''\
"""A user's program; the folders beside it are the laboratory's own."""

import drivers
import instrument
import registration
import sim

import picoradar
from picoradar import SimulatedBench, estimate, load_model, open_recording, prepare_model, register
from picoradar.registration import Model, Registration


def registered(points: list[list[float]], model: Model) -> str:
    found: Registration = register(points, model)
    return found.verdict


FOREIGN: list[str] = [drivers.NAME, instrument.NAME, registration.NAME, sim.NAME]
FRONT = (SimulatedBench, estimate, load_model, open_recording, prepare_model, register)
print(FOREIGN, picoradar.__version__, all(map(callable, FRONT)))
'''


@pytest.fixture
def laboratory(tmp_path: Path) -> Path:
    """A folder with packages of the same names as ours, and a program that uses both."""
    for name in FOLDERS:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f'NAME = "the laboratory\'s {name}"\n')
    (tmp_path / "program.py").write_text(USER_PROGRAM)
    return tmp_path


def test_foreign_folders_of_the_same_names_and_ours_are_imported_side_by_side(laboratory: Path) -> None:
    done = subprocess.run(
        [sys.executable, "program.py"], cwd=laboratory, capture_output=True, text=True, check=False, timeout=50
    )
    assert done.returncode == 0, done.stderr
    assert str([f"the laboratory's {name}" for name in sorted(FOLDERS)]) in done.stdout
    assert f"{picoradar.__version__} True" in done.stdout


def test_the_command_does_not_care_where_it_runs_nor_for_pythonpath(laboratory: Path) -> None:
    command = [sys.executable, "-I", "-m", "picoradar.instrument.cli", "scan", "--grid", "2x2", "-o", "scan.db"]
    environment = {**os.environ, "PYTHONPATH": str(laboratory)}
    done = subprocess.run(
        command, cwd=laboratory, env=environment, capture_output=True, text=True, check=False, timeout=50
    )
    assert done.returncode == 0, done.stderr
    assert (laboratory / "scan.db").exists()


@pytest.mark.parametrize("name", picoradar.__all__)
def test_every_name_of_the_front_is_there(name: str) -> None:
    assert getattr(picoradar, name) is not None
    assert name in dir(picoradar)


def test_an_unknown_name_of_the_front_is_said() -> None:
    with pytest.raises(AttributeError, match="module 'picoradar' has no attribute 'registre'"):
        picoradar.registre  # noqa: B018


def test_importing_the_front_loads_nothing_heavy() -> None:
    code = "import sys, picoradar; print([m for m in ('numpy', 'pydantic', 'serial') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, check=True).stdout == (
        "[]\n"
    )


def test_help_loads_nothing_heavy() -> None:
    heavy = ("numpy", "pydantic", "serial", "structlog", "picoradar.registration", "picoradar.sim")
    code = f"""
import sys
from picoradar.instrument.cli.main import run
run(["--help"])
print([m for m in {heavy} if m in sys.modules], file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, check=True)
    assert "Usage: picoradar" in done.stdout
    assert done.stderr == "[]\n"


def test_every_room_offers_what_it_names() -> None:
    rooms = [
        ".".join(("picoradar", *init.parent.relative_to(ROOT).parts))
        for folder in FOLDERS
        for init in (ROOT / folder).rglob("__init__.py")
    ]
    assert len(rooms) > 40
    for room in rooms:
        module = importlib.import_module(room)
        missing = [name for name in getattr(module, "__all__", []) if not hasattr(module, name)]
        assert not missing, room
        assert module.__doc__, f"{room} does not say what it is for"


def test_settings_of_the_first_version_find_the_served_bench_under_its_new_name() -> None:
    old = Links(usb_backend="sim.usb.forward:backend", usb_address="127.0.0.1:9")
    assert old.usb_backend == "picoradar.sim.usb.forward:backend"
    module, function = old.usb_backend.split(":")
    assert callable(getattr(importlib.import_module(module), function))


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_the_built_wheel_works_and_carries_its_types(
    laboratory: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("wheel")
    quiet = ["--quiet", "--disable-pip-version-check"]
    built = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", *quiet, "--no-deps", "-w", str(folder), str(ROOT)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if built.returncode:
        pytest.skip(reason=f"no wheel could be built here, perhaps for lack of a network: {built.stderr[-300:]}")
    (wheel,) = folder.glob("picoradar-*.whl")
    # An environment of its own: the wheel, and the dependencies of this one by a path file.
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder / "venv")], check=True)
    (packages,) = (folder / "venv").glob("**/site-packages")
    (packages / "dependencies.pth").write_text(str(Path(numpy.__file__).parents[1]) + "\n")
    subprocess.run(
        [sys.executable, "-m", "pip", "install", *quiet, "--no-deps", "--target", str(packages), str(wheel)], check=True
    )
    python = folder / "venv" / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    check = textwrap.dedent(f"""
        import runpy, sys
        import picoradar
        assert picoradar.__file__.startswith({str(packages)!r}), picoradar.__file__
        sys.path.insert(0, ".")
        runpy.run_path("program.py")
        from picoradar.sim.physics import HIP_FILE
        from picoradar.instrument.settings.profiles import PROFILES, profile_text
        assert HIP_FILE.is_file() and all(profile_text(name) for name in PROFILES)
    """)
    done = subprocess.run([python, "-c", check], cwd=laboratory, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    typed = [sys.executable, "-m", "mypy", "--strict", "--python-executable", str(python), "program.py"]
    done = subprocess.run(typed, cwd=laboratory, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    (laboratory / "program.py").write_text(USER_PROGRAM.replace("found: Registration", "found: int"))
    done = subprocess.run(typed, cwd=laboratory, capture_output=True, text=True, check=False)
    assert 'expression has type "Registration"' in done.stdout


def test_no_part_of_libigl_with_another_licence_is_loaded() -> None:
    program = """
        import sys
        from picoradar.registration import prepare_model
        from picoradar.registration.model.curvature import *
        import numpy, igl
        corners = numpy.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9.0]])
        prepare_model(corners, numpy.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
        print(sorted(name for name in sys.modules if name.startswith(("igl.copyleft", "igl.triangle"))))
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, check=False, timeout=55
    )
    assert (done.stdout.strip(), done.returncode) == ("[]", 0), done.stderr
