"""Prepared models on disk: ready at once, by content, and never trusted when damaged."""

from __future__ import annotations

import errno
import io
import json
import os
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from picoradar import registration
from picoradar.instrument.cli.main import run
from picoradar.registration.model import Place, clear_cache, contents_of_cache


def files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*"))


@pytest.fixture(scope="module")
def small() -> registration.Model:
    """A coarse hemisphere, quickly prepared."""
    u, v = np.meshgrid(np.linspace(0.05, 1.4, 16), np.linspace(0, 2 * np.pi, 32, endpoint=False), indexing="ij")
    vertices = 15.0 * np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), -np.cos(u)], axis=-1).reshape(-1, 3)
    a = (np.arange(15)[:, None] * 32 + np.arange(32)).ravel()
    b = (np.arange(15)[:, None] * 32 + (np.arange(32) + 1) % 32).ravel()
    faces = np.concatenate([np.stack([a, b, b + 32], axis=1), np.stack([a, b + 32, a + 32], axis=1)])
    return registration.prepare_model(vertices, faces)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PICORADAR_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_the_second_preparation_reads_what_the_first_wrote(small: registration.Model, folder: Path) -> None:
    first = registration.prepare_model(small.vertices, small.faces)
    (path,) = files(folder)
    written = path.stat().st_mtime_ns
    second = registration.prepare_model(small.vertices, small.faces)
    assert path.stat().st_mtime_ns == written
    assert second.report == first.report
    for one, other in zip(first.views, second.views, strict=True):
        np.testing.assert_array_equal(one.fine.nodes, other.fine.nodes)
        np.testing.assert_array_equal(one.centre, other.centre)
        assert one.coarse.shape == other.coarse.shape


def test_another_mesh_has_another_file(small: registration.Model, folder: Path) -> None:
    registration.prepare_model(small.vertices, small.faces)
    registration.prepare_model(small.vertices + 1.0, small.faces)
    assert len(files(folder)) == 2


@pytest.mark.parametrize("damage", [b"", b"no zip file", None])
def test_a_damaged_file_is_made_anew(small: registration.Model, folder: Path, damage: bytes | None) -> None:
    registration.prepare_model(small.vertices, small.faces)
    (path,) = files(folder)
    good = path.read_bytes()
    path.write_bytes(good[: len(good) // 2] if damage is None else damage)
    model = registration.prepare_model(small.vertices, small.faces)
    assert len(model.views) == len(small.views)
    assert len(path.read_bytes()) == len(good)


def test_a_folder_that_cannot_be_written_costs_a_warning(
    small: registration.Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("PICORADAR_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(RuntimeWarning, match="could not be kept"):
        registration.prepare_model(small.vertices, small.faces)


def test_a_view_made_for_a_start_is_kept(small: registration.Model, folder: Path) -> None:
    """The hemisphere is seen from its outer side."""
    model = registration.prepare_model(small.vertices, small.faces)
    first = model.view_of(Place.of(np.array([0.0, 0.0, -15.0]), np.array([0.0, 0.0, -1.0]), 30.0, model.settings.view))
    kept = files(folder)
    assert len(kept) == 2
    again = registration.prepare_model(small.vertices, small.faces)
    second = again.view_of(
        Place.of(np.array([1.0, 0.0, -15.0]), np.array([0.05, 0.0, -1.0]), 30.0, model.settings.view)
    )
    assert files(folder) == kept
    np.testing.assert_array_equal(first.fine.nodes, second.fine.nodes)


def test_a_further_socket_is_prepared_when_it_is_asked_for(small: registration.Model, folder: Path) -> None:
    vertices = np.concatenate([small.vertices, small.vertices * 1.1 + [80.0, 0.0, 0.0]])
    faces = np.concatenate([small.faces, small.faces + len(small.vertices)])[:, ::-1]  # hollow side out
    model = registration.prepare_model(vertices, faces)
    assert len(model.views) == 2
    assert len(files(folder)) == 1
    fine = model.views[1].fine
    kept = files(folder)
    assert len(kept) == 2
    again = registration.prepare_model(vertices, faces)
    np.testing.assert_array_equal(again.views[1].fine.nodes, fine.nodes)
    np.testing.assert_array_equal(again.views[1].centre, model.views[1].centre)
    assert files(folder) == kept


def test_a_mesh_file_is_parsed_once(
    small: registration.Model, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "bowl.stl"
    mesh = trimesh.Trimesh(small.vertices, small.faces)
    file.write_bytes(trimesh.exchange.stl.export_stl(mesh))
    first = registration.load_model(file)
    copy = tmp_path / "the same under another name.stl"
    copy.write_bytes(file.read_bytes())
    with monkeypatch.context() as patch:
        patch.setattr(trimesh, "load", lambda *_, **__: pytest.fail("it was parsed before"))
        again = registration.load_model(copy)
    assert again.name == copy.name
    np.testing.assert_array_equal(again.vertices, first.vertices)
    np.testing.assert_array_equal(again.views[0].fine.nodes, first.views[0].fine.nodes)
    mesh.apply_translation([1.0, 0.0, 0.0])
    file.write_bytes(trimesh.exchange.stl.export_stl(mesh))
    moved = registration.load_model(file)
    np.testing.assert_allclose(moved.centre, first.centre + [1.0, 0.0, 0.0], atol=1e-5)
    for path in files(folder):
        if path.stat().st_size > 10_000:
            path.unlink()
    np.testing.assert_array_equal(registration.load_model(copy).vertices, first.vertices)


def test_a_file_that_changes_while_it_is_read_is_not_remembered(
    small: registration.Model, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "bowl.stl"
    mesh = trimesh.Trimesh(small.vertices, small.faces)
    given = trimesh.exchange.stl.export_stl(mesh)
    moved = trimesh.exchange.stl.export_stl(mesh.copy().apply_translation([5.0, 0.0, 0.0]))
    file.write_bytes(given)
    load = trimesh.load

    def swapped(*args: object, **keywords: object) -> object:
        file.write_bytes(moved)
        return load(*args, **keywords)

    with monkeypatch.context() as patch:
        patch.setattr(trimesh, "load", swapped)
        registration.load_model(file)
    file.write_bytes(given)
    np.testing.assert_allclose(registration.load_model(file).centre, small.centre, atol=1e-5)


@pytest.mark.parametrize("seed", range(40))
def test_wrong_bytes_in_a_file_are_never_believed(small: registration.Model, folder: Path, seed: int) -> None:
    """Bytes of the headers: those of the fields themselves are guarded by their check sum."""
    registration.prepare_model(small.vertices, small.faces)
    (path,) = files(folder)
    content = bytearray(path.read_bytes())
    rng = np.random.default_rng(seed)
    headers = [i for i in range(len(content) - 160) if content[i : i + 4] in (b"PK\x03\x04", b"PK\x01\x02", b"\x93NUM")]
    for _ in range(3):
        at = int(rng.choice(headers)) + int(rng.integers(0, 128))
        content[at] ^= 1 << int(rng.integers(0, 8))
    path.write_bytes(bytes(content))
    again = registration.prepare_model(small.vertices, small.faces)
    np.testing.assert_array_equal(again.vertices, small.vertices)
    np.testing.assert_array_equal(again.faces, small.faces)
    np.testing.assert_array_equal(again.views[0].fine.nodes, small.views[0].fine.nodes)


def test_a_model_can_be_sent_to_another_process(small: registration.Model, folder: Path) -> None:
    for model in (registration.prepare_model(small.vertices, small.faces) for _ in range(2)):
        sent = pickle.loads(pickle.dumps(model))
        np.testing.assert_array_equal(sent.views[0].fine.nodes, small.views[0].fine.nodes)


def test_a_full_disk_leaves_no_half_written_file(
    small: registration.Model, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.warns(RuntimeWarning, match="could not be kept"):
        registration.prepare_model(small.vertices, small.faces)
    assert files(folder) == []


def prepared(model: registration.Model, offset_mm: float, folder: Path) -> Path:
    """Prepare a model that was moved, and get its file."""
    before = set(files(folder))
    registration.prepare_model(model.vertices + offset_mm, model.faces)
    (made,) = set(files(folder)) - before
    return made


def test_the_file_of_another_model_is_not_believed(small: registration.Model, folder: Path) -> None:
    """As after a mix-up of names: sound in itself, and of another bone."""
    mine, other = prepared(small, 0.0, folder), prepared(small, 10.0, folder)
    other.replace(mine)
    again = registration.prepare_model(small.vertices, small.faces)
    np.testing.assert_array_equal(again.vertices, small.vertices)
    np.testing.assert_allclose(again.views[0].centre, small.views[0].centre)


def test_a_mesh_file_known_as_another_one_is_not_believed(
    small: registration.Model, folder: Path, tmp_path: Path
) -> None:
    meshes = []
    for offset_mm in (0.0, 10.0):
        mesh = tmp_path / f"{offset_mm:g}.stl"
        mesh.write_bytes(trimesh.exchange.stl.export_stl(trimesh.Trimesh(small.vertices + offset_mm, small.faces)))
        meshes.append(mesh)
    known = []
    for mesh in meshes:
        before = set(files(folder))
        registration.load_model(mesh)
        known.append(next(path for path in set(files(folder)) - before if "-file-" in path.name))
    known[1].replace(known[0])
    np.testing.assert_allclose(registration.load_model(meshes[0]).centre, small.centre, atol=1e-4)


@pytest.mark.parametrize("member", ["vertices", "faces", "places", "fine", "report"])
def test_changed_content_is_not_believed_though_its_check_sums_fit(
    small: registration.Model, folder: Path, member: str
) -> None:
    path = prepared(small, 0.0, folder)
    with zipfile.ZipFile(path) as stored:
        members = {name: stored.read(name) for name in stored.namelist()}
    values = np.load(io.BytesIO(members[f"{member}.npy"]))
    if member == "report":
        changed = np.array(str(values).replace('"closed": false', '"closed": true '))
        assert str(changed) != str(values)
    else:
        changed = values.copy()
        changed.reshape(-1)[0] += 1
    written = io.BytesIO()
    np.save(written, changed)
    with zipfile.ZipFile(path, "w") as stored:
        for name, content in {**members, f"{member}.npy": written.getvalue()}.items():
            stored.writestr(name, content)
    again = registration.prepare_model(small.vertices, small.faces)
    np.testing.assert_array_equal(again.vertices, small.vertices)
    np.testing.assert_array_equal(again.faces, small.faces)
    np.testing.assert_array_equal(again.views[0].fine.nodes, small.views[0].fine.nodes)
    np.testing.assert_array_equal(again.views[0].centre, small.views[0].centre)
    assert not again.closed


@pytest.mark.skipif(os.name == "nt", reason="rights of files are POSIX")
def test_a_file_that_others_may_write_to_is_not_believed(small: registration.Model, folder: Path) -> None:
    path = prepared(small, 0.0, folder)
    assert path.stat().st_mode & 0o077 == 0
    assert folder.stat().st_mode & 0o077 == 0
    path.chmod(0o666)
    written = path.stat().st_ino
    registration.prepare_model(small.vertices, small.faces)
    assert path.stat().st_ino != written
    assert path.stat().st_mode & 0o077 == 0


def test_what_was_not_used_for_longest_makes_room(
    small: registration.Model, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = [prepared(small, float(offset), folder) for offset in range(3)]
    for offset in (0.0, 1.0, 2.0, 0.0):  # file systems note the first of these reads by themselves, not the last
        registration.prepare_model(small.vertices + offset, small.faces)
    size = kept[0].stat().st_size
    monkeypatch.setenv("PICORADAR_CACHE_MIB", str(2.5 * size / 2**20))
    newest = prepared_at(small, 3.0, folder)
    assert set(files(folder)) == {kept[0], newest}
    monkeypatch.setenv("PICORADAR_CACHE_MIB", "0")
    newest = prepared_at(small, 4.0, folder)
    assert files(folder) == [newest]  # what was just made stays


def prepared_at(model: registration.Model, offset_mm: float, folder: Path) -> Path:
    registration.prepare_model(model.vertices + offset_mm, model.faces)
    return max(files(folder), key=lambda path: path.stat().st_mtime_ns)


def test_files_of_earlier_versions_and_abandoned_ones_go_and_nothing_else(
    small: registration.Model, folder: Path
) -> None:
    folder.mkdir()
    names = {
        "registration-v3-old.npz": False,
        "registration-v9999-of-a-later-version.npz": True,
        "registration-abandoned.part": False,
        "registration-being-written.part": True,
        "download.part": True,
        "notes.txt": True,
    }
    for name in names:
        (folder / name).write_bytes(b"x" * 100)
        if name in ("registration-abandoned.part", "download.part"):
            os.utime(folder / name, (1.0, 1.0))
    registration.prepare_model(small.vertices, small.faces)
    left = {path.name for path in files(folder)}
    assert {name: name in left for name in names} == names


def test_the_cache_is_shown_and_cleared(
    small: registration.Model, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert contents_of_cache().models == 0
    prepared(small, 0.0, folder)
    prepared(small, 1.0, folder)
    (folder / "notes.txt").write_text("not of the cache")
    assert run(["cache", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["folder"], told["models"], told["files"]) == (str(folder), 2, 2)
    assert told["bytes"] == sum(path.stat().st_size for path in files(folder)) - len("not of the cache")
    assert told["limit_bytes"] == 2**30
    assert run(["cache", "--clear", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["models"], told["bytes"], told["removed_models"]) == (0, 0, 2)
    assert [path.name for path in files(folder)] == ["notes.txt"]
    prepared(small, 0.0, folder)
    assert run(["cache", "clear"]) == 0
    assert clear_cache().models == 0
    assert run(["cache", "forget"]) == 2
    assert "show or clear" in capsys.readouterr().err
