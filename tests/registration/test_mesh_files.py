"""Mesh files as they come: names in Latin-1 are read; what is cut short or claims to be large is refused in words."""

from __future__ import annotations

import base64
import itertools
import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from picoradar.registration.errors import MeshError
from picoradar.registration.model import load_model
from picoradar.registration.model.mesh import validated
from picoradar.registration.model.reading import read_mesh
from tests.memory import peak_bytes

BODY = trimesh.creation.icosphere(subdivisions=2, radius=30.0)
A_FEW_BYTES = 10_000_000


def refused(suffix: str, content: bytes, words: str) -> None:
    with pytest.raises(MeshError, match=words) as raised:
        read_mesh(Path(f"model{suffix}"), content)
    assert str(raised.value).startswith(f"model{suffix}: ")


def stl_text(name: bytes) -> bytes:
    text: str = BODY.export(file_type="stl_ascii")
    return b"solid " + name + b"\n" + text.encode().split(b"\n", 1)[1]


@pytest.mark.parametrize("name", [b"H\xfcfte", "Hüfte".encode(), b"\xb7\xff\xfe\x81", b"hip"])
def test_a_text_stl_with_a_name_in_any_encoding(name: bytes) -> None:
    vertices, faces = read_mesh(Path("model.stl"), stl_text(name))
    assert len(faces) == len(BODY.faces)
    assert np.allclose(vertices[faces], BODY.triangles, atol=1e-5)


def test_a_normal_that_is_none_costs_no_traceback_in_the_log(
    caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    content = stl_text(b"hip").replace(b"normal ", b"normal x", 1)
    vertices, faces = read_mesh(Path("model.stl"), content)
    assert np.allclose(vertices[faces], BODY.triangles, atol=1e-5)
    assert "Traceback" not in caplog.text + capsys.readouterr().err


@pytest.mark.parametrize(("suffix", "comment"), [(".obj", b"# Patient M\xfcller\n"), (".ply", b"comment M\xfcller\n")])
def test_text_with_a_comment_in_latin_1(suffix: str, comment: bytes) -> None:
    if suffix == ".obj":
        content = comment + BODY.export(file_type="obj").encode()
    else:
        plain: bytes = BODY.export(file_type="ply", encoding="ascii")
        content = plain.replace(b"format ascii 1.0\n", b"format ascii 1.0\n" + comment)
    vertices, faces = read_mesh(Path(f"model{suffix}"), content)
    assert np.allclose(vertices[faces], BODY.triangles, atol=1e-5)


def test_a_binary_stl_that_begins_as_a_text_one() -> None:
    content = bytearray(BODY.export(file_type="stl"))
    content[:5] = b"solid"
    vertices, faces = read_mesh(Path("model.stl"), bytes(content))
    assert np.allclose(vertices[faces], BODY.triangles, atol=1e-5)
    refused(".stl", bytes(content[:-100]), f"header says {len(BODY.faces)} triangles, the file has room for 318")


def test_what_no_file_may_claim() -> None:
    refused(".stl", bytes(80) + b"\xff\xff\xff\xff", "header says 4294967295 triangles, the file has room for 0")
    ply = "ply\nformat {} 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n"
    refused(".ply", ply.format("ascii").encode(), "cannot be read as a mesh")
    refused(".ply", ply.format("binary_little_endian").encode(), "cannot be read as a mesh")


def vtp(points: str, *, header: str = "UInt32", before: str = "") -> bytes:
    return (
        f'<?xml version="1.0"?>{before}<VTKFile type="PolyData" byte_order="LittleEndian" header_type="{header}" '
        f'compressor="vtkZLibDataCompressor"><PolyData><Piece NumberOfPoints="3" NumberOfPolys="1"><Points>'
        f'<DataArray type="Float64" NumberOfComponents="3" format="binary">{points}</DataArray></Points><Polys>'
        f'<DataArray type="Int64" Name="connectivity" format="ascii">0 1 2</DataArray>'
        f'<DataArray type="Int64" Name="offsets" format="ascii">3</DataArray></Polys></Piece></PolyData></VTKFile>'
    ).encode()


def blocks(*plain: bytes, stated: int | None = None, last: int = 0) -> str:
    packed = [zlib.compress(one) for one in plain]
    block = len(plain[0]) if stated is None else stated
    head = struct.pack(f"<{3 + len(plain)}I", len(plain), block, last, *map(len, packed))
    return (base64.b64encode(head) + base64.b64encode(b"".join(packed))).decode()


CORNERS = np.array([[0, 0, 0], [60, 0, 0], [0, 40, 0]], dtype="<f8").tobytes()


def test_compressed_blocks_are_read() -> None:
    for points in (blocks(CORNERS), blocks(CORNERS[:48], CORNERS[48:], last=24), blocks(CORNERS[:36], CORNERS[36:])):
        vertices, faces = read_mesh(Path("model.vtp"), vtp(points))
        assert vertices.tobytes() == CORNERS
        assert faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (blocks(bytes(60_000_000), stated=72), "has not the 72 bytes that it states"),
        (blocks(CORNERS, stated=80), "has not the 80 bytes that it states"),
        (blocks(*[b""] * 2000, stated=2**30), "bytes; at most"),
        (base64.b64encode(struct.pack("<4I", 2**30, 8, 8, 8)).decode(), "cut off"),
        ("!!", "cannot be read as a mesh"),
    ],
)
def test_a_vtp_bomb_is_not_unpacked(points: str, words: str) -> None:
    content = vtp(points)
    assert len(content) < 100_000
    assert peak_bytes(lambda: refused(".vtp", content, words)) < A_FEW_BYTES


def test_entities_are_refused_by_this_program_and_not_only_by_a_new_expat() -> None:
    names = "abcdefghij"
    entities = "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in itertools.pairwise(names))
    bomb = f'<!DOCTYPE VTKFile [<!ENTITY a "lol">{entities}]>'
    refused(".vtp", vtp("&j;", before=bomb), "defines entities")
    refused(".vtp", vtp("&x;", before='<!DOCTYPE x [<!ENTITY x SYSTEM "file:///etc/passwd">]>'), "defines entities")


def test_polygons_that_overlap_would_multiply() -> None:
    many = " ".join(["3000", "0"] * 3000)
    content = vtp(blocks(CORNERS)).replace(b">3<", f">{many}<".encode()).replace(b">0 1 2<", b">" + b"0 " * 3000 + b"<")
    refused(".vtp", content, "do not end one after the other")


def glb(change: Callable[[dict[str, Any]], object]) -> bytes:
    content: bytes = BODY.export(file_type="glb")
    length = int.from_bytes(content[12:16], "little")
    table = json.loads(content[20 : 20 + length])
    change(table)
    text = json.dumps(table).encode()
    text += b" " * (-len(text) % 4)
    rest = content[20 + length :]
    total = 20 + len(text) + len(rest)
    return struct.pack("<4sII", b"glTF", 2, total) + struct.pack("<I4s", len(text), b"JSON") + text + rest


def test_the_glb_helper_changes_nothing_by_itself() -> None:
    vertices, faces = read_mesh(Path("model.glb"), glb(lambda _: None))
    assert np.allclose(vertices[faces], BODY.triangles, atol=1e-4)


def zeros(table: dict[str, Any]) -> None:
    """Arrays without data are zeros by the specification: a few bytes would become gigabytes."""
    for accessor in table["accessors"]:
        del accessor["bufferView"]
        accessor["count"] = 10**9


def in_many_places(table: dict[str, Any]) -> None:
    table["nodes"] += [{"mesh": 0}] * 9000
    indices = table["meshes"][0]["primitives"][0]["indices"]
    table["accessors"][indices]["count"] = 3 * 1280


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (zeros, "has 1000000000 entries; at most"),
        (in_many_places, "triangles; at most"),
        (lambda table: table["nodes"].extend([{}] * 10_001), "nodes; at most"),
        (lambda table: table["accessors"][0].update(count=-1), "has -1 entries"),
        (lambda table: table["accessors"][0].update(count="9"), "has '9' entries"),
        (lambda table: table.update(accessors={}), "cannot be read as a mesh"),
        (lambda table: table.update(nodes=[0]), "cannot be read as a mesh"),
        (lambda table: table.update(meshes=[[]]), "cannot be read as a mesh"),
        (lambda table: table["meshes"][0]["primitives"][0].update(attributes=[]), "cannot be read as a mesh"),
        (lambda table: table["buffers"][0].update(uri="/etc/passwd"), "cannot be read as a mesh"),
    ],
)
def test_a_glb_that_would_become_large(change: Callable[[dict[str, Any]], object], words: str) -> None:
    content = glb(change)
    assert peak_bytes(lambda: refused(".glb", content, words)) < A_FEW_BYTES


def test_files_beside_a_model_are_not_opened(tmp_path: Path) -> None:
    """Materials, textures and buffers of other files take no part, so that a model cannot name what is read."""
    (tmp_path / "skin.mtl").write_text("newmtl skin\nmap_Kd /etc/passwd\n")
    content = b"mtllib skin.mtl\nusemtl skin\n" + BODY.export(file_type="obj").encode()
    vertices, faces = read_mesh(tmp_path / "model.obj", content)
    assert np.allclose(vertices[faces], BODY.triangles, atol=1e-5)


@pytest.mark.parametrize(("scale", "words"), [(1e-4, "in metres"), (1e3, "is in another unit"), (1e30, "another unit")])
def test_a_model_in_another_unit_is_refused_before_it_is_prepared(scale: float, words: str) -> None:
    """Preparation takes memory by the volume: a single vertex astray cost gigabytes."""
    with pytest.raises(MeshError, match=words):
        validated(BODY.vertices * scale, BODY.faces)
    astray = BODY.vertices.copy()
    astray[0] *= scale
    if scale > 1.0:
        with pytest.raises(MeshError, match=words):
            validated(astray, BODY.faces)


def test_memory_that_is_not_there_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object, **__: object) -> None:
        raise MemoryError

    path = tmp_path / "model.stl"
    path.write_bytes(BODY.export(file_type="stl"))
    monkeypatch.setenv("PICORADAR_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("picoradar.registration.model.prepared.find_views", none)
    with pytest.raises(MeshError, match="needs more memory than there is"):
        load_model(path)
