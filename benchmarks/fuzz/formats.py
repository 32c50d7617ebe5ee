"""The formats that are fuzzed: sound files, how they are mutated, how the program reads them."""

from __future__ import annotations

import functools
import io
import json
import random
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.fuzz import mutate
from benchmarks.fuzz.recordings import sound_recordings, table_value
from benchmarks.fuzz.vtp import packed_block, sound_vtp
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.cli.commands.info import describe_recording
from picoradar.instrument.cli.register_inputs import read_regions, read_start, read_targets
from picoradar.instrument.cli.simulated import checked_simulation
from picoradar.instrument.errors import PicoradarError
from picoradar.instrument.files.points import read_points
from picoradar.instrument.recording import Recording, plain
from picoradar.instrument.settings import Settings, load_settings, settings_from, to_toml
from picoradar.registration import prepare_model
from picoradar.registration.errors import RegistrationError
from picoradar.registration.model.mesh import validated
from picoradar.registration.model.reading import read_mesh
from picoradar.sim.faults import load_scenario
from picoradar.sim.replay import ReplayedBench
from picoradar.sim.settings import SimulationSettings

PREPARED_SHARE = 0.002
"""Share of the meshes that are not only read and validated, but prepared, which takes a second."""

POSE = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 900.0], [0.0, 0.0, 0.0, 1.0]]


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes
    ----------
    suffix : str
    seeds : callable
        Makes sound files.
    read : callable
        Reads a file as the program does.
    refusals : tuple of exception types
        What a refusal in words is.
    own : tuple of mutations
        Those that know the format.
    words : tuple of bytes
    """

    suffix: str
    seeds: Callable[[], Sequence[bytes]]
    read: Callable[[Path], object]
    refusals: tuple[type[Exception], ...]
    own: tuple[mutate.Mutation, ...] = ()
    words: tuple[bytes, ...] = ()

    @functools.cached_property
    def sound(self) -> Sequence[bytes]:
        """Get the sound files, made once."""
        return self.seeds()

    def input(self, name: str, seed: int, index: int) -> bytes:
        """Make the input of a number; the same one every time."""
        return mutate.mutated(random.Random(f"{name} {seed} {index}"), self.sound, self.own, self.words)


def _model(path: Path) -> None:
    content = path.read_bytes()
    vertices, faces = read_mesh(path, content)
    validated(vertices, faces)
    if zlib.crc32(content) < PREPARED_SHARE * 2**32 and len(faces) < 5000:
        prepare_model(vertices, faces)


def _recording(path: Path) -> None:
    with Recording.open(path) as recording:
        plain(describe_recording(recording))
        recording.events()
        plain(recording.summary)
        recording.cloud(skip_damaged=True)
        if recording.header.get("settings"):
            settings_from(recording.header["settings"], str(path))
        if recording.header.get("calibration"):
            Calibration.from_json(json.dumps(recording.header["calibration"]), str(path))
    read_points(path)


def _json(path: Path) -> None:
    """Read it as each of the inputs that it may be; refused is what none of them takes."""
    readers: tuple[Callable[[Path], object], ...] = (
        read_targets,
        read_regions,
        lambda file: read_start("any", file),
        lambda file: read_start(str(file), None),
    )
    refused = []
    for read in readers:
        try:
            read(path)
        except PicoradarError as error:
            refused.append(error)
    if len(refused) == len(readers):
        raise refused[-1]


def _settings(path: Path) -> None:
    settings = load_settings(path)
    if settings.bench == "simulated":
        checked_simulation(settings)


def _replay(path: Path) -> None:
    with ReplayedBench(path):
        pass


def _mesh_seeds(kind: str) -> list[bytes]:
    bodies = [trimesh.creation.box((60, 50, 40)), trimesh.creation.icosphere(subdivisions=1, radius=30.0)]
    made = [body.export(file_type=kind) for body in bodies]
    if kind == "stl":
        made.append(bodies[0].export(file_type="stl_ascii"))
    if kind == "ply":
        made.append(bodies[0].export(file_type="ply", encoding="ascii"))
    return [one.encode() if isinstance(one, str) else one for one in made]


def _points(count: int = 40) -> np.ndarray:
    return np.random.default_rng(1).normal(size=(count, 3)) * 20.0 + [0.0, 0.0, 900.0]


ABOUT = {
    "range_error": '{"bias_mm": 2.5, "material": "bone", "sd_mm": 0.4}',
    "zero_check": '{"by": "mark", "largest_mm": 0.1, "outcome": "passed", "sentence": "checked"}',
}
"""What an export says of its points, JSON text by name."""


def _archives() -> list[bytes]:
    points, made = _points(), []
    for save in (np.savez, np.savez_compressed):
        content = io.BytesIO()
        more = {"row": np.arange(40), "column": np.arange(40), "covariance_mm2": np.tile(np.eye(3), (40, 1, 1))}
        more |= {name: np.array(text) for name, text in ABOUT.items()}
        save(content, points_mm=points, origin_mm=np.zeros(3), response_mv=np.ones(40), **more)
        made.append(content.getvalue())
    return made


def _clouds() -> list[bytes]:
    points = _points()
    text = "\n".join(" ".join(f"{x:.6g}" for x in row) for row in points)
    about = "".join(f"comment picoradar {name} {text}\n" for name, text in ABOUT.items())
    about = about.replace("{", "{{").replace("}", "}}")
    head = f"ply\nformat {{}} 1.0\ncomment made here\n{about}"
    head += "element vertex 40\n" + "".join(f"property {{}} {a}\n" for a in "xyz")
    plain_head = head.format("ascii", "float", "float", "int") + "end_header\n"
    rows = "\n".join(f"{x:.6g} {y:.6g} {int(z)}" for x, y, z in points)
    packed = head.format("binary_little_endian", "double", "double", "double") + "end_header\n"
    return [f"{plain_head}{rows}\n".encode(), packed.encode() + points.tobytes(), text.encode()][:2]


def _tables() -> list[bytes]:
    points = _points()
    rows = [",".join(f"{x:.6g}" for x in row) for row in points]
    about = "".join(f"# picoradar {name} {text}\n" for name, text in ABOUT.items()).encode()
    return [b"x_mm,y_mm,z_mm\n" + about + "\n".join(rows).encode(), "\n".join(rows).replace(",", " ").encode(),
            b"# made by hand\nrow;column;x;y;z\n" + b"\n".join(b"0;%d;1;2;900" % k for k in range(20))]  # fmt: skip


def _landmarks() -> list[bytes]:
    place = {"scanner": [0.0, 0.0, 900.0], "model": [1.0, 2.0, 3.0], "position": [1, 2, 3], "name": "rim"}
    region = {"center": [0, 0, 0], "radius_mm": 3.0}
    cone = {"towards": [0, 0, 1], "half_angle_deg": 20}
    contents = ([place] * 3, [region], POSE, cone, {"model_from_scanner": POSE})
    return [json.dumps(content).encode() for content in contents]


def _toml() -> list[bytes]:
    text = to_toml(Settings(), SimulationSettings())
    links = 'bench = "devices"\n[links]\ndg645 = "socket://127.0.0.1:9"\ngenesys = "/dev/ttyUSB0"\ntec = "COM3"\n'
    return [
        text.encode(),
        links.encode(),
        b"[scan]\nrows = 4\ncolumns = 4\n[pulser]\nmeasured_output = [[290.0, 8e4, 0.3]]\n",
    ]


def _fault_files() -> list[bytes]:
    one = '[[fault]]\nkind = "{}"\nlink = "{}"\nat = {{{} = 3}}\nlasts_s = 2.0\n'
    return [(one.format("reply_lost", "tec", "command") + one.format("misfire", "bench", "pulse")).encode(),
            one.format("interlock_opened", "bench", "time_s").encode()]  # fmt: skip


def _transcripts() -> list[bytes]:
    events = [
        {"transcript": "picoradar", "version": 1},
        {"time_s": 0.0, "link": "DG645", "what": "open", "url": "sim://bench/dg645", "baud": 9600},
        {"time_s": 0.1, "link": "DG645", "what": "write", "data": "2a49444e3f0a"},
        {"time_s": 0.2, "link": "DG645", "what": "read", "data": "00ff"},
        {"time_s": 0.3, "link": "bridge", "what": "control_in", "data": "", "request": 3, "value": 0},
    ]
    return ["".join(json.dumps(event) + "\n" for event in events).encode()]


def _calibrations() -> list[bytes]:
    return [(resources.files("picoradar.instrument") / "data" / "simulated-bench.json").read_bytes()]


_MESH = functools.partial(Format, read=_model, refusals=(RegistrationError,))
_CLOUD = functools.partial(Format, read=read_points, refusals=(PicoradarError,))

FORMATS: dict[str, Format] = {
    "stl": _MESH(".stl", lambda: _mesh_seeds("stl"), words=(b"solid ", b"facet normal 0 0 1\n", b"\xfc")),
    "ply": _MESH(".ply", lambda: _mesh_seeds("ply"), words=(b"element face 9999999\n", b"property list int int x\n")),
    "obj": _MESH(".obj", lambda: _mesh_seeds("obj"), words=(b"\nf -1 -2 -3", b"\nf 1//1 2//2", b"\nusemtl x\n", b"/")),
    "glb": _MESH(".glb", lambda: _mesh_seeds("glb"), own=(mutate.glb_table,)),
    "vtp": _MESH(".vtp", sound_vtp, own=(packed_block,), words=(b"<!ENTITY a 'b'>", b"</Piece>", b'format="ascii"')),
    "npz": _CLOUD(".npz", _archives, own=(mutate.archive_member,)),
    "ply-points": _CLOUD(".ply", _clouds, words=(b"property list uchar int x\n", b"element vertex 9\n")),
    "csv": _CLOUD(".csv", _tables, words=(b",", b";", b"\n", b"\0", b"x,y,z\n")),
    "xyz": _CLOUD(".xyz", _tables, words=(b" ", b"\t", b"#", b"\r")),
    "json": Format(".json", _landmarks, _json, (PicoradarError,), own=(mutate.json_value,)),
    "calibration": Format(".json", _calibrations, Calibration.load, (PicoradarError,), own=(mutate.json_value,)),
    "toml": Format(".toml", _toml, _settings, (PicoradarError,), words=(b"a.", b"[[x]]\n", b"'''", b'"""')),
    "faults": Format(".toml", _fault_files, load_scenario, (ValueError,), words=(b"[[fault]]\n", b"a.b.")),
    "transcript": Format(".jsonl", _transcripts, _replay, (ValueError,), words=(b"\n", b'"data": "0"')),
    "recording": Format(".db", sound_recordings, _recording, (PicoradarError,), own=(table_value,)),
}  # fmt: skip
"""By name; `ply` is a mesh and `ply-points` a cloud."""
