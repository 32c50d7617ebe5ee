"""Point files: what any program writes is read, what cannot be used is refused with file, line and remedy."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.instrument.files.points import PointFileError, read_points
from picoradar.instrument.files.points.limits import MOST_POINTS
from picoradar.instrument.recording import RecordingError
from tests.memory import peak_bytes

POINTS = [[1.5, -2.0, 900.25], [3.0, 4.0, 901.0]]


@pytest.mark.parametrize(
    "text",
    [
        "x_mm,y_mm,z_mm\n1.5,-2.0,900.25\n3,4,901\n",
        "1.5 -2.0 900.25\n3 4 901",
        "# made by hand\n\n1.5;-2.0;900.25\r\n3;4;901\r\n",
        "\ufeffX, Y, Z\n1.5, -2.0, 900.25  # first\n3, 4, 901\n",
        "//X Y Z R\n1.5\t-2\t900.25\t7\n3\t4\t901\t8\n",
        '"z","x","y"\n900.25,1.5,-2\n901,3,4\n',
    ],
)
@pytest.mark.parametrize("suffix", [".csv", ".xyz"])
def test_text_of_many_habits(tmp_path: Path, text: str, suffix: str) -> None:
    path = tmp_path / f"points{suffix}"
    path.write_bytes(text.encode())
    assert read_points(path).points.tolist() == POINTS


def test_columns_by_name(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("row,column,response_mv,x,y,z\n0,1,40,1,2,3\n1,1,41,4,5,6\n")
    found = read_points(path)
    assert found.grid is not None
    assert found.grid.tolist() == [[0, 1], [1, 1]]
    assert found.response_mv is not None
    assert found.response_mv.tolist() == [40, 41]
    assert found.origin is None


@pytest.mark.parametrize(
    ("text", "line", "word"),
    [
        ("x,y,z\n1,2,3\n1,2,nan\n", 3, "finite"),
        ("1,2,3\n\n1,inf,3\n", 3, "finite"),
        ("1,2,3\n1,2\n", 2, "2 numbers, where 3"),
        ("1,2,3\n1,two,3\n", 2, "not all numbers"),
        ("1,2\n3,4\n", 1, "2 columns"),
        ("1,5;2,5;3,5\n", 1, "decimals"),
        ("a,b,c\n1,2,3\n", None, "none of them x"),
        ("x,y,z\n", None, "holds no points"),
        ("\n\n# nothing\n", None, "holds no points"),
    ],
)
def test_text_that_is_refused(tmp_path: Path, text: str, line: int | None, word: str) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text)
    with pytest.raises(PointFileError, match=word) as refused:
        read_points(path)
    assert refused.value.line == line
    assert str(path) in str(refused.value)


def ply(body: bytes, form: str = "ascii", count: int = 2, kind: str = "float") -> bytes:
    head = f"ply\nformat {form} 1.0\ncomment x\nelement vertex {count}\n"
    head += "".join(f"property {kind} {axis}\n" for axis in "xyz")
    return (head + "element face 0\nproperty list uchar int vertex_indices\nend_header\n").encode() + body


@pytest.mark.parametrize(
    "content",
    [
        ply(b"1.5 -2 900.25\n3 4 901\n"),
        ply(np.array(POINTS, "<f4").tobytes(), "binary_little_endian"),
        ply(np.array(POINTS, ">f8").tobytes(), "binary_big_endian", kind="double"),
    ],
)
def test_ply_of_every_form(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "points.ply"
    path.write_bytes(content)
    assert read_points(path).points.tolist() == POINTS


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "is empty"),
        (b"solid mesh", "begin with 'ply'"),
        (b"ply\nformat ascii 1.0\n", "no end_header"),
        (ply(b"1 2 3\n"), "cut off"),
        (ply(b"1 2 3\n1 2\n"), "is no point"),
        (ply(np.zeros(5, "<f4").tobytes(), "binary_little_endian"), "cut off: 4 bytes"),
        (ply(np.full(6, np.nan, "<f4").tobytes(), "binary_little_endian"), "finite"),
        (ply(b"", count=0), "holds no points"),
        (ply(b"", form="packed"), "format 'packed'"),
        (ply(b"1 2 3\n" * 2).replace(b"vertex", b"corner"), "'vertex'"),
        (ply(b"1 2 3\n" * 2).replace(b"float x", b"list uchar int x"), "not a plain number"),
        (ply(b"1 2 3\n" * 2).replace(b"float y", b"float x"), "one twice"),
    ],
)
def test_ply_that_is_refused(tmp_path: Path, content: bytes, word: str) -> None:
    path = tmp_path / "points.ply"
    path.write_bytes(content)
    with pytest.raises(PointFileError, match=word):
        read_points(path)


def archive(**arrays: object) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def test_archive(tmp_path: Path) -> None:
    path = tmp_path / "points.npz"
    path.write_bytes(archive(points=np.array(POINTS), covariance_mm2=np.ones((2, 3, 3)), origin_mm=np.zeros(3)))
    found = read_points(path)
    assert found.points.tolist() == POINTS
    assert found.covariance is not None
    assert found.origin is not None
    assert found.grid is None


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"PK nothing", "no archive"),
        (b"\x93NUMPY...", "no archive"),
        (archive(data=np.zeros(3)), "has the arrays data"),
        (archive(points=np.zeros((3, 2))), r"float64 \(3, 2\)"),
        (archive(points=np.array([["a", "b", "c"]])), "its points are"),
        (archive(points=np.zeros((2, 3)), covariance_mm2=np.zeros((3, 3, 3))), "covariance_mm2"),
        (archive(points=np.zeros((2, 3)), row=np.zeros(2), column=np.zeros(3)), "column"),
        (archive(points=np.zeros((2, 3)), origin_mm=np.array(["a", "b", "c"])), "origin_mm"),
        (archive(points=np.full((1, 3), np.inf)), "finite"),
        (archive(points=np.array([[None, 1, 2]], dtype=object)), "no archive of plain arrays"),
    ],
)
def test_archive_that_is_refused(tmp_path: Path, content: bytes, word: str) -> None:
    path = tmp_path / "points.npz"
    path.write_bytes(content)
    with pytest.raises(PointFileError, match=word):
        read_points(path)


def test_unknown_ending_and_missing_file(tmp_path: Path) -> None:
    with pytest.raises(PointFileError, match="no such file"):
        read_points(tmp_path / "points.csv")
    other = tmp_path / "points.docx"
    other.write_text("1 2 3")
    with pytest.raises(PointFileError, match=r"use one of \.ply \.csv"):
        read_points(other)


def test_a_line_of_separators_is_refused_with_its_number(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("x,y,z\n1,2,3\n;;\n")
    with pytest.raises(PointFileError, match=r"line 3: ';;' has separators and no numbers"):
        read_points(path)


@settings(max_examples=150, deadline=None)
@given(content=st.binary(max_size=300), suffix=st.sampled_from([".ply", ".csv", ".xyz", ".npz"]), head=st.booleans())
def test_garbage_is_refused_and_never_a_stack_trace(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, suffix: str, head: bool
) -> None:
    path = tmp_path_factory.getbasetemp() / f"garbage{suffix}"
    path.write_bytes(
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n" if head else b"") + content
    )
    try:
        found = read_points(path)
    except (PointFileError, RecordingError):
        return
    assert np.isfinite(found.points).all()


def npz(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return path


def npy(values: object, dtype: str = "<f8") -> bytes:
    content = io.BytesIO()
    np.save(content, np.asarray(values, dtype=dtype))
    return content.getvalue()


def promise(shape: tuple[int, ...], descr: str = "<f8") -> bytes:
    """A header that states more than follows."""
    content = io.BytesIO()
    np.lib.format.write_array_header_1_0(content, {"shape": shape, "fortran_order": False, "descr": descr})
    return content.getvalue()


BOMB = bytes(60_000_000)


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"points_mm": promise((10**12, 3))}, "has not the 24000000000000 bytes"),
        ({"points_mm": promise((4, 3)) + BOMB}, "has not the 96 bytes"),
        ({"points_mm": promise((-1, 3))}, "has not the"),
        ({"points_mm": promise((10**6, 3), "<U1000")}, "has not the"),
        ({"points_mm": promise((4, 3), "|O") + b"\x80\x04K\x01."}, "Python objects"),
        ({"points_mm": b"\x93NUMPY\x03\x00" + bytes(20)}, "later version"),
        ({"points_mm": b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535}, "no archive of plain arrays"),
        ({"points_mm": b""}, "no archive of plain arrays"),
        ({"points_mm": npy(POINTS), "covariance_mm2": promise((10**12, 3, 3))}, "covariance_mm2.npy has not the"),
        ({"points_mm": npy(POINTS), "row": npy([1, np.nan]), "column": npy([1, 2])}, "no places of a raster"),
        ({"other": BOMB}, "has the arrays other"),
    ],
)
def test_an_archive_is_judged_before_it_is_unpacked(tmp_path: Path, members: dict[str, bytes], words: str) -> None:
    path = npz(tmp_path / "points.npz", **members)
    assert path.stat().st_size < 100_000

    def refused() -> None:
        with pytest.raises(PointFileError, match=words):
            read_points(path)

    assert peak_bytes(refused) < 10_000_000


def test_an_array_that_is_not_needed_is_not_unpacked(tmp_path: Path) -> None:
    path = npz(tmp_path / "points.npz", points_mm=npy(POINTS), traces=BOMB)
    assert peak_bytes(lambda: read_points(path)) < 10_000_000
    assert read_points(path).points.tolist() == POINTS


def test_an_array_of_more_points_than_are_read(tmp_path: Path) -> None:
    path = tmp_path / "points.npz"
    many = np.zeros((MOST_POINTS + 1, 3), dtype="<i1")
    np.savez_compressed(path, points_mm=many)
    with pytest.raises(PointFileError, match=f"at most {MOST_POINTS} are read"):
        read_points(path)


def test_a_damaged_stream_of_an_archive(tmp_path: Path) -> None:
    path = tmp_path / "points.npz"
    np.savez_compressed(path, points_mm=np.random.default_rng(1).normal(size=(200, 3)))
    content = bytearray(path.read_bytes())
    content[200:210] = b"\xff" * 10
    path.write_bytes(content)
    with pytest.raises(PointFileError, match="no archive of plain arrays"):
        read_points(path)


@pytest.mark.parametrize("number", ["inf", "1e309", "-inf", "nan", "4294967296"])
def test_a_whole_number_that_is_none(tmp_path: Path, number: str) -> None:
    path = tmp_path / "points.ply"
    head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty int x\nproperty int y\nproperty int z\nend_header\n"
    path.write_text(f"{head}1 2 3\n4 {number} 6\n")
    with pytest.raises(PointFileError, match=r"points.ply, line 9: '4 .* 6' is no point"):
        read_points(path)


def test_more_points_than_a_ply_may_state(tmp_path: Path) -> None:
    path = tmp_path / "points.ply"
    for count in (MOST_POINTS + 1, 4_000_000_000, 10**17):
        path.write_text(f"ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nend_header\n1\n")
        with pytest.raises(PointFileError, match=f"states {count} points"):
            read_points(path)
