"""Validation of models, exact closest points and reading of files."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
import trimesh

from picoradar import registration
from picoradar.registration.model import Surface, build_fields, part, prepared, visible_shell
from picoradar.registration.model.curvature import principal_curvatures
from picoradar.registration.model.mesh import signed_volume

CUBE = np.array([[x, y, z] for x in (0, 10) for y in (0, 10) for z in (0, 10)], dtype=float)
CUBE_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    + [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)


def test_cube_is_closed_and_turned_outward() -> None:
    model = registration.prepare_model(CUBE, CUBE_FACES[:, ::-1])
    assert model.closed
    assert signed_volume(model.vertices, model.faces) == pytest.approx(1000.0)
    assert registration.prepare_model(CUBE, CUBE_FACES).report.turned_inside_out != model.report.turned_inside_out


def test_triangle_soup_is_merged_and_doubled_faces_are_dropped() -> None:
    soup = CUBE[CUBE_FACES].reshape(-1, 3)
    faces = np.arange(36).reshape(-1, 3)
    model = registration.prepare_model(soup, np.concatenate([faces, faces[:1], [[0, 0, 1]]]))
    assert len(model.vertices) == 8
    assert len(model.faces) == 12
    assert model.closed
    assert any("merged" in finding for finding in model.report.findings)


def test_closest_points_have_sign_and_gradient_on_faces_edges_and_corners() -> None:
    model = registration.prepare_model(CUBE, CUBE_FACES)
    found = model.closest(np.array([[5.0, 5, 12], [5, 5, 9], [12, 12, 5], [13, 13, 13], [5, 5, 10]]))
    np.testing.assert_allclose(found.signed_mm, [2, -1, np.sqrt(8), np.sqrt(27), 0], atol=1e-12)
    np.testing.assert_allclose(found.normals[0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(found.normals[1], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(found.normals[2], np.array([1, 1, 0]) / np.sqrt(2), atol=1e-12)
    np.testing.assert_allclose(found.normals[3], np.ones(3) / np.sqrt(3), atol=1e-12)


def test_the_shell_holds_only_what_the_scanner_can_see() -> None:
    model = registration.prepare_model(CUBE, CUBE_FACES)
    shell = visible_shell(model.surface, np.array([0.0, 0.0, 1.0]), 5.0)
    assert set(np.round(shell.vertices[:, 2])) >= {10.0}
    assert (shell.face_normals[:, 2] > -0.1).all()


@pytest.mark.parametrize(("cosine", "seen"), [(0.015, 1), (0.025, 2)])
def test_faces_seen_flatter_than_a_fiftieth_return_no_echo(cosine: float, seen: int) -> None:
    """A level plate, and one that stands so steep beside it."""
    edge = np.array([1.0, 0.0, 0.0])
    up = np.array([0.0, cosine, np.sqrt(1.0 - cosine**2)])
    steep = np.array([edge * 9.0 + 30.0, edge * -9.0 + 30.0, up * 9.0 + 30.0])
    level = np.array([[9.0, 0.0, 0.0], [-9.0, 9.0, 0.0], [-9.0, -9.0, 0.0]])
    surface = Surface(np.concatenate([level, steep]), np.array([[0, 1, 2], [3, 4, 5]]))
    sides = np.abs(surface.face_normals[:, 2])
    np.testing.assert_allclose(sides, [1.0, cosine], atol=1e-9)
    facing = Surface(
        surface.vertices, np.where(surface.face_normals[:, 2:] > 0.0, surface.faces, surface.faces[:, ::-1])
    )
    assert len(visible_shell(facing, np.array([0.0, 0.0, 1.0]), 1e-6).faces) == seen


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3), int), "empty"),
        (CUBE, np.zeros((0, 3), int), "empty"),
        (np.where(CUBE == 0, np.nan, CUBE), CUBE_FACES, "NaN or infinite"),
        (np.where(CUBE == 0, np.inf, CUBE), CUBE_FACES, "NaN or infinite"),
        (CUBE / 1000.0, CUBE_FACES, "metres"),
        (CUBE, CUBE_FACES + 1, "damaged"),
        (CUBE, CUBE_FACES.astype(float), "whole numbers"),
        (CUBE, np.array([[0, 1, 1]]), "no face with an area"),
        (CUBE[:, :2], CUBE_FACES, "triangle mesh has"),
    ],
)
def test_bad_meshes_are_refused(vertices: np.ndarray, faces: np.ndarray, message: str) -> None:
    with pytest.raises(registration.MeshError, match=message):
        registration.prepare_model(vertices, faces)


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".glb"])
def test_files_are_read(tmp_path: Path, suffix: str) -> None:
    import trimesh

    path = tmp_path / f"cube{suffix}"
    trimesh.Trimesh(CUBE, CUBE_FACES, process=False).export(path)
    model = registration.load_model(path)
    assert model.closed
    assert signed_volume(model.vertices, model.faces) == pytest.approx(1000.0, rel=1e-6)


def vtp_ascii(vertices: np.ndarray, polygons: list[list[int]], others: str = "") -> str:
    return vtp_of(vtp_piece(vertices, polygons, others))


def vtp_of(*pieces: str) -> str:
    return (
        '<?xml version="1.0"?><VTKFile type="PolyData" version="0.1" byte_order="LittleEndian"><PolyData>'
        + "".join(pieces)
        + "</PolyData></VTKFile>"
    )


def vtp_piece(vertices: np.ndarray, polygons: list[list[int]], others: str = "") -> str:
    """One piece; `others` are cells of another kind, given as XML."""
    points = " ".join(str(v) for v in vertices.ravel())
    connectivity = " ".join(str(v) for polygon in polygons for v in polygon)
    offsets = " ".join(str(v) for v in np.cumsum([len(polygon) for polygon in polygons]))
    return (
        f'<Piece NumberOfPoints="{len(vertices)}" NumberOfPolys="{len(polygons)}"><Points><DataArray type="Float32" '
        f'NumberOfComponents="3" format="ascii">{points}</DataArray></Points>{others}<Polys><DataArray type="Int64" '
        f'Name="connectivity" format="ascii">{connectivity}</DataArray><DataArray type="Int64" Name="offsets" '
        f'format="ascii">{offsets}</DataArray></Polys></Piece>'
    )


def test_vtp_is_read(tmp_path: Path) -> None:
    path = tmp_path / "cube.vtp"
    path.write_text(vtp_ascii(CUBE, CUBE_FACES.tolist()))
    assert registration.load_model(path).closed


PYRAMID = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0], [5, 5, 9]])
PYRAMID_BASE = [0, 3, 2, 1]
PYRAMID_SIDES = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
PYRAMID_VOLUME_MM3 = 300.0
LOOSE_CELLS = (
    '<Verts><DataArray type="Int64" Name="connectivity" format="ascii">0 1</DataArray>'
    '<DataArray type="Int64" Name="offsets" format="ascii">1 2</DataArray></Verts>'
    '<Strips><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2 3</DataArray>'
    '<DataArray type="Int64" Name="offsets" format="ascii">4</DataArray></Strips>'
)


@pytest.mark.parametrize("others", ["", LOOSE_CELLS], ids=["alone", "beside vertices and strips"])
@pytest.mark.parametrize(
    "polygons",
    [
        [PYRAMID_BASE, *PYRAMID_SIDES],
        [*PYRAMID_SIDES, PYRAMID_BASE],
        [*PYRAMID_SIDES[:2], PYRAMID_BASE, *PYRAMID_SIDES[2:]],
    ],
    ids=["quad first", "quad last", "quad between"],
)
def test_vtp_with_polygons_of_several_sizes_is_read(tmp_path: Path, polygons: list[list[int]], others: str) -> None:
    path = tmp_path / "pyramid.vtp"
    path.write_text(vtp_ascii(PYRAMID, polygons, others))
    model = registration.load_model(path)
    assert len(model.faces) == 6
    assert model.closed
    assert not model.report.turned_inside_out
    assert signed_volume(model.vertices, model.faces) == pytest.approx(PYRAMID_VOLUME_MM3)


@pytest.mark.parametrize("sizes", list(itertools.permutations([3, 4, 5, 6])))
def test_vtp_polygons_keep_their_area_in_any_order(tmp_path: Path, sizes: tuple[int, ...]) -> None:
    """Regular polygons of radius 10 mm side by side: area n / 2 r^2 sin(2 pi / n) each."""
    corners, polygons = [], []
    for place, n in enumerate(sizes):
        angle = 2.0 * np.pi * np.arange(n) / n
        polygons.append((sum(sizes[:place]) + np.arange(n)).tolist())
        corners.append(np.stack([30.0 * place + 10.0 * np.cos(angle), 10.0 * np.sin(angle), np.zeros(n)], axis=1))
    path = tmp_path / "polygons.vtp"
    path.write_text(vtp_ascii(np.concatenate(corners), polygons))
    model = registration.load_model(path)
    a, b, c = model.vertices[model.faces].transpose(1, 0, 2)
    area = np.cross(b - a, c - a)[:, 2].sum() / 2.0  # signed: a fan that is wound the other way counts against it
    assert len(model.faces) == sum(n - 2 for n in sizes)
    assert area == pytest.approx(sum(n / 2.0 * 100.0 * np.sin(2.0 * np.pi / n) for n in sizes), rel=1e-6)


def test_vtp_in_pieces_is_read_whole(tmp_path: Path) -> None:
    """A piece counts its own vertices from 0; one without polygons takes no part."""
    path = tmp_path / "pyramid.vtp"
    base, sides = vtp_piece(PYRAMID[:4], [PYRAMID_BASE]), vtp_piece(PYRAMID, PYRAMID_SIDES)
    path.write_text(vtp_of(base, "<Piece><Points/><Polys/></Piece>", sides))
    model = registration.load_model(path)
    assert model.closed
    assert signed_volume(model.vertices, model.faces) == pytest.approx(PYRAMID_VOLUME_MM3)


def test_vtp_whose_piece_names_a_vertex_of_another_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "pyramid.vtp"
    path.write_text(vtp_of(vtp_piece(PYRAMID[:4], [[0, 1, 4]]), vtp_piece(PYRAMID, PYRAMID_SIDES)))
    with pytest.raises(registration.MeshError, match="names vertex 4, the piece has 4"):
        registration.load_model(path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("model.txt", b"x", "one of .stl"),
        ("gone.stl", None, "no such file"),
        ("broken.stl", b"solid nothing", "broken.stl"),
        ("broken.vtp", b"<VTKFile><PolyData>", "cannot be read"),
        ("empty.vtp", b"<VTKFile><PolyData/></VTKFile>", "no PolyData piece"),
        ("broken.ply", b"ply\nformat nonsense", "broken.ply"),
    ],
)
def test_unreadable_files_are_refused_by_name(tmp_path: Path, name: str, content: bytes | None, message: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(registration.MeshError, match=message):
        registration.load_model(path)


@pytest.mark.parametrize("turned", [False, True])
def test_a_ball_bulges_and_a_bowl_is_hollow_by_its_radius(turned: bool) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=25.0)
    surface = Surface(np.asarray(ball.vertices), np.asarray(ball.faces)[:, ::-1] if turned else np.asarray(ball.faces))
    # A paraboloid laid through the cap of five rings, 9 mm wide, bends more than the ball by (9 / 25)^2 / 4 = 3 %.
    np.testing.assert_allclose(principal_curvatures(surface), (-1 if turned else 1) / 25.0, rtol=0.04)


def test_curvatures_of_a_cylinder_are_kept_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PICORADAR_CACHE", str(tmp_path))
    tube = trimesh.creation.cylinder(radius=10.0, height=40.0, sections=64).subdivide_to_size(2.5)
    model = registration.prepare_model(np.asarray(tube.vertices), np.asarray(tube.faces))
    middle = np.abs(model.vertices[:, 2]) < 10.0
    np.testing.assert_allclose(np.median(model.curvatures[middle], axis=0), [0.1, 0.0], atol=0.003)
    (kept,) = tmp_path.glob("*-curvatures.npz")
    monkeypatch.setattr(prepared, "principal_curvatures", lambda _: pytest.fail("they are there already"))
    again = registration.prepare_model(np.asarray(tube.vertices), np.asarray(tube.faces))
    np.testing.assert_array_equal(again.curvatures, model.curvatures)
    assert kept.exists()


def test_beyond_the_border_of_an_open_model_its_field_says_nothing() -> None:
    """A plate: above it distances and normals, beside it a positive distance and no direction, on either side."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-10.0, 10.0, 11), np.linspace(-10.0, 10.0, 11), indexing="ij"))
    a = (np.arange(10)[:, None] * 11 + np.arange(10)).ravel()
    faces = np.concatenate([np.stack([a, a + 11, a + 12], axis=1), np.stack([a, a + 12, a + 1], axis=1)])
    plate = Surface(np.stack([x, y, 0.0 * x], axis=1), faces)
    assert plate.border.sum() == 40
    fine, coarse = build_fields(plate, np.full(3, -20.0), np.full(3, 20.0))
    above = np.array([[3.0, -2.0, 1.0], [0.0, 4.0, -1.5]]).T.astype(np.float32)
    beside = np.array([[14.0, 0.0, 1.0], [14.0, 3.0, -1.0], [-13.0, -13.0, -2.0]]).T.astype(np.float32)
    for field in (fine, coarse):
        distance, gradient = field.sample(above)
        np.testing.assert_allclose(distance, [1.0, -1.5], atol=1e-5)
        np.testing.assert_allclose(gradient, [[0.0, 0.0, 1.0]] * 2, atol=1e-5)
        distance, gradient = field.sample(beside)
        assert (distance > 2.0).all()
        assert not gradient.any()


def test_a_part_keeps_the_border_of_the_whole_and_gets_no_other() -> None:
    x, y = (a.ravel() for a in np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij"))
    a = (np.arange(4)[:, None] * 5 + np.arange(4)).ravel()
    faces = np.concatenate([np.stack([a, a + 5, a + 6], axis=1), np.stack([a, a + 6, a + 1], axis=1)])
    plate = Surface(np.stack([x, y, 0.0 * x], axis=1), faces)
    half = part(plate, plate.vertices[plate.faces][:, :, 0].max(axis=1) < 2.5)
    assert plate.border.sum() == 16
    assert half.border.sum() == 8, "four edges on the far side, two and two beside; none along the cut"
    beside = half.closest(np.array([[1.0, -2.0, 0.5], [-2.0, 2.5, 0.5], [3.0, 2.5, 0.5], [1.2, 1.3, 0.5]]))
    assert half.beyond_border(beside).tolist() == [True, True, False, False]
    cube = registration.prepare_model(CUBE, CUBE_FACES)
    assert not cube.surface.border.any()


def test_fields_are_good_where_points_are_looked_for(socket: registration.Model) -> None:
    """Exact near the surface, interpolated from steps of 4 mm farther off, as far as tissue stands in front of bone."""
    view = socket.views[0]
    shell = visible_shell(socket.surface, view.axis, 30.0)
    rng = np.random.default_rng(0)
    at = view.centre + rng.uniform(-24.0, 24.0, (20_000, 3))
    at = at[(at - view.centre) @ view.axis < 0.0]
    exact = shell.closest(at)
    for field, limits in ((view.fine, (0.08, 0.2, 1.0)), (view.coarse, (0.15, 0.25, 1.5))):
        error = np.abs(field.sample((at - view.centre).T.astype(np.float32))[0] - exact.signed_mm)
        for (near, far), limit in zip(((0.0, 1.0), (1.0, 3.0), (3.0, 9.0)), limits, strict=True):
            there = (np.abs(exact.signed_mm) >= near) & (np.abs(exact.signed_mm) < far)
            assert np.sqrt(np.mean(error[there] ** 2)) < limit, (field.step_mm, near, far)


def test_a_ridge_between_two_corners_of_the_border_is_no_border() -> None:
    """However coarse the tessellation: above the ridge of a tent there is bone."""
    corners = np.array([[0.0, 0, 0], [40, 0, 0], [0, -20, -10], [40, -20, -10], [0, 20, -10], [40, 20, -10]])
    tent = Surface(corners, np.array([[0, 2, 3], [0, 3, 1], [0, 1, 5], [0, 5, 4]]))
    above = tent.closest(np.array([[10.0, 0.0, 3.0], [20.0, 0.5, 3.0], [-3.0, 0.0, 1.0]]))
    assert tent.beyond_border(above).tolist() == [False, False, True]
