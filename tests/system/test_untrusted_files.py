"""No file makes the program load a library, write where the command line did not say, or reach another address.

The commands run in a process that watches itself from inside (`watched.py`). What is refused is tested elsewhere; here
it counts what was done.
"""

from __future__ import annotations

import io
import json
import os
import pickle
import shutil
import sqlite3
import struct
import subprocess
import sys
import zipfile
import zlib
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from picoradar.instrument.cli.main import run

WATCHED = Path(__file__).with_name("watched.py")
ADDRESS = "127.0.0.1:9"  # nothing listens there: the connection is refused at once


class Writes:
    """A pickle that would make a file."""

    def __init__(self, path: Path) -> None:
        self.path = str(path)

    def __reduce__(self) -> tuple[Any, tuple[str, str]]:
        return open, (self.path, "w")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("untrusted")
    for name in ("in", "out", "cache", "config"):
        (path / name).mkdir()
    (path / "in" / "victim").write_text("the thesis")
    calibration = resources.files("picoradar.instrument") / "data" / "simulated-bench.json"
    (path / "in" / "calibrated.json").write_bytes(calibration.read_bytes())
    (path / "in" / "evil.so").write_bytes(b"\x7fELF, in intent")
    (path / "in" / "evil_module.py").write_text("backend = print\n")
    return path


def settings(folder: Path) -> dict[str, str]:
    """Settings by name; what each tries is told by its content."""
    inside, victim = folder / "in", folder / "in" / "victim"
    usual = {
        "dg645": f'"socket://{ADDRESS}"', "genesys": f'"socket://{ADDRESS}"', "tec": f'"socket://{ADDRESS}"',
        "usb_backend": '"picoradar.sim.usb.forward:backend"', "usb_address": f'"{ADDRESS}"',
    }  # fmt: skip

    def devices(calibration: Path = inside / "calibrated.json", **links: str) -> str:
        lines = "\n".join(f"{key} = {value}" for key, value in {**usual, **links}.items())
        return f'bench = "devices"\ncalibration = "{calibration}"\n[links]\n{lines}\n'

    return {
        "a library as backend": devices(usb_backend='"usb.libloader:load_library"', usb_address=f'"{inside}/evil.so"'),
        "a module as backend": devices(usb_backend='"evil_module:backend"'),
        "spy": devices(dg645=f'"spy:///dev/null?file={victim}"'),
        "spy on a socket": devices(tec=f'"spy://socket://{ADDRESS}?file={victim}"'),
        "a class of pyserial": devices(genesys='"alt:///dev/null?class=PosixPollSerial"'),
        "a port by pattern": devices(dg645='"hwgrep://.*"'),
        "a handler out of a module": devices(dg645='"evil_module://x"'),
        "a file as port": devices(dg645=f'"{victim}"', tec=f'"{victim}"', genesys='"/dev/null"'),
        "an option of a socket": devices(dg645=f'"socket://{ADDRESS}?logging=debug"'),
        "addresses as they should be": devices(),
        "a calibration": devices(calibration=victim),
        "a target": f'[simulation]\ntarget = "{victim}"\n',
        "an unknown key": f'[simulation]\nlog_file = "{victim}"\n',
    }


def glb_with(folder: Path, uri: str) -> bytes:
    content: bytes = trimesh.creation.box((60, 50, 40)).export(file_type="glb")
    length = int.from_bytes(content[12:16], "little")
    table = json.loads(content[20 : 20 + length])
    table["buffers"][0]["uri"] = uri
    table["images"] = [{"uri": uri}]
    text = json.dumps(table).encode()
    text += b" " * (-len(text) % 4)
    rest = content[20 + length :]
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON") + text + rest


def models(folder: Path) -> dict[str, bytes]:
    victim, box = folder / "in" / "victim", trimesh.creation.box((60, 50, 40))
    entity = f'<!DOCTYPE VTKFile [<!ENTITY x SYSTEM "http://{ADDRESS}/x"><!ENTITY y SYSTEM "file://{victim}">]>'
    ply: bytes = box.export(file_type="ply", encoding="ascii")
    return {
        "material.obj": f"mtllib {victim}\nusemtl x\n{box.export(file_type='obj')}".encode(),
        "file.glb": glb_with(folder, str(victim)),
        "network.glb": glb_with(folder, f"http://{ADDRESS}/x"),
        "entity.vtp": f"<?xml version='1.0'?>{entity}<VTKFile>&x;&y;</VTKFile>".encode(),
        "texture.ply": ply.replace(b"element vertex", f"comment TextureFile {victim}\nelement vertex".encode(), 1),
    }


def archive(folder: Path) -> bytes:
    """Points in a pickle that makes a file."""
    member, content = io.BytesIO(), io.BytesIO()
    header = {"shape": (1,), "fortran_order": False, "descr": "|O"}
    np.lib.format.write_array_header_1_0(member, header)
    member.write(pickle.dumps(Writes(folder / "in" / "pickled")))
    with zipfile.ZipFile(content, "w") as made:
        made.writestr("points_mm.npy", member.getvalue())
        made.writestr(f"../../{folder.name}/in/slipped.npy", b"x")
    return content.getvalue()


@pytest.fixture(scope="module")
def recordings(folder: Path) -> list[Path]:
    """Recordings that were broken off, whose headers carry the settings above; and one with a trigger."""
    sound, fault = folder / "in" / "sound.db", folder / "in" / "emergency.json"
    fault.write_text(json.dumps({"fault": [{"kind": "interlock_opened", "at": {"pulse": 60_000}}]}))
    assert run(["scan", "--grid", "3x2", "--seed", "4", "-o", str(sound), "--faults", str(fault)]) == 4
    with sqlite3.connect(sound) as database:
        header = json.loads(database.execute("SELECT header FROM scan").fetchone()[0])
    database.close()
    made = []
    for number, text in enumerate(settings(folder).values()):
        path = folder / "in" / f"recording-{number}.db"
        shutil.copy(sound, path)
        links = dict(line.split(" = ") for line in text.splitlines() if " = " in line)
        given = header["settings"]
        changed = {
            **given,
            "links": {**given["links"], **{k: v[1:-1] for k, v in links.items() if k in given["links"]}},
        }
        if "[links]" in text:
            changed["bench"] = "devices"
        else:
            changed["simulation"] = {k: v[1:-1] for k, v in links.items()}
        content = json.dumps({**header, "settings": changed, "scanner": {}})
        with sqlite3.connect(path) as database:
            database.execute("UPDATE scan SET header=?, header_crc32=?", (content, zlib.crc32(content.encode())))
        database.close()
        made.append(path)
    path = folder / "in" / "recording-trigger.db"
    shutil.copy(sound, path)
    with sqlite3.connect(path) as database:
        database.execute("CREATE TRIGGER t AFTER UPDATE ON scan BEGIN DELETE FROM line; END")
    database.close()
    return [*made, path]


@pytest.fixture(scope="module")
def cases(folder: Path, recordings: list[Path]) -> list[dict[str, Any]]:
    inside, out, victim = folder / "in", folder / "out", folder / "in" / "victim"
    box = inside / "box.stl"
    trimesh.creation.box((60, 50, 40)).export(box)
    cloud = inside / "cloud.csv"
    cloud.write_text("x,y,z\n" + "".join(f"{x},{y},900\n" for x in range(8) for y in range(8)))
    made = [
        ("warm up scan", ["scan", "--grid", "2x2", "-o", str(out / "warm.db")]),
        ("warm up register", ["register", str(cloud), str(box), "--json"]),
        ("warm up export", ["export", str(out / "warm.db"), "-o", str(out / "warm.npz")]),
        ("warm up doctor", ["doctor"]),
    ]
    for number, (name, text) in enumerate(settings(folder).items()):
        path = inside / f"settings-{number}.toml"
        path.write_text(text)
        made.append((f"settings: {name}", ["doctor", "--settings", str(path)]))
        made.append((f"scan: {name}", ["scan", "--settings", str(path), "-o", str(out / f"scan-{number}.db")]))
    for path in recordings:
        made.append((f"info: {path.name}", ["info", str(path)]))
        made.append((f"resume: {path.name}", ["resume", str(path), "--yes"]))
    made.append(("export: recording", ["export", str(recordings[0]), "-o", str(out / "cloud.csv")]))
    for name, content in models(folder).items():
        (inside / name).write_bytes(content)
        made.append((f"model: {name}", ["register", str(cloud), str(inside / name)]))
        made.append(
            (
                f"target: {name}",
                ["scan", "--grid", "1x2", "--target", str(inside / name), "-o", str(out / f"{name}.db")],
            )
        )
    (inside / "pickled.npz").write_bytes(archive(folder))
    made.append(("points: pickled.npz", ["register", str(inside / "pickled.npz"), str(box)]))
    for option in ("--landmarks", "--targets", "--exclude", "--start"):
        path = inside / f"{option[2:]}.json"
        entry = {"scanner": str(victim), "model": f"http://{ADDRESS}", "position": str(victim), "name": str(victim)}
        path.write_text(json.dumps([entry]))
        made.append((f"{option}", ["register", str(cloud), str(box), option, str(path)]))
    calibration = inside / "calibration.json"
    calibration.write_text(json.dumps({"format": 1, "provenance": str(victim), "include": str(victim)}))
    made.append(("calibration", ["calibration", "show", str(calibration)]))
    faults = inside / "faults.toml"
    faults.write_text(f'[[fault]]\nkind = "evil_module:backend"\nlink = "{victim}"\nat = {{time_s = 1}}\n')
    made.append(("faults", ["scan", "--grid", "2x2", "--faults", str(faults), "-o", str(out / "faults.db")]))
    transcript = inside / "session.jsonl"
    opened = {"time_s": 0, "link": "DG645", "what": "open", "url": f"spy:///dev/null?file={victim}", "baud": 9600}
    transcript.write_text(json.dumps({"transcript": "picoradar", "version": 1}) + "\n" + json.dumps(opened) + "\n")
    made.append(("transcript", ["python:replay", str(transcript)]))
    return [{"name": name, "command": command} for name, command in made]


def watched(folder: Path, cases: list[dict[str, Any]]) -> list[dict[str, Any]]:
    file = folder / "cases.json"
    file.write_text(json.dumps(cases))
    environment = {
        **os.environ, "PYTHONPATH": f"{folder / 'in'}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
        "PICORADAR_CACHE": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1",
        "MPLCONFIGDIR": str(folder / "config"),
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, str(WATCHED), str(file)], env=environment, cwd=folder / "in", capture_output=True, text=True,
        stdin=subprocess.DEVNULL, timeout=170, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


def test_the_watching_sees_what_it_should(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "evil.so").write_bytes(b"no library")
    (case,) = watched(tmp_path, [{"name": "provoke", "command": ["python:provoke", str(tmp_path / "in")]}])
    kinds = [kind for kind, _ in case["events"]]
    assert {kind: kinds.count(kind) for kind in sorted(set(kinds))} == {"connect": 1, "load": 2, "start": 1, "write": 4}


@pytest.mark.timeout(180)  # 5 s of processor time; a loaded machine with a slow disk takes ten times as long
def test_no_file_makes_the_program_do_what_was_not_asked_for(folder: Path, cases: list[dict[str, Any]]) -> None:
    found = watched(folder, cases)
    assert {case["name"]: case["status"] for case in found if isinstance(case["status"], str)} == {}
    for case in found:
        own = [str(folder / "out"), str(folder / "cache"), str(folder / "config"), os.environ["PICORADAR_LOG"]]
        if case["command"][0] == "resume":  # a recording is written to when it is gone on with, as the command says
            own += [case["command"][1], str(folder / "in" / ".picoradar-probe-")]  # whether its folder takes lines
        for kind, what in case["events"]:
            in_the_file = case["name"].startswith(("settings", "scan", "resume")) and what == str(("127.0.0.1", 9))
            allowed = what.startswith(tuple(own)) if kind == "write" else kind == "connect" and in_the_file
            assert allowed, (case["name"], kind, what)
    assert (folder / "in" / "victim").read_text() == "the thesis"
    assert not (folder / "in" / "pickled").exists()
    reached = [case["name"] for case in found if any(kind == "connect" for kind, _ in case["events"])]
    assert any("as they should be" in name for name in reached), "no address was reached at all: the test sees nothing"
