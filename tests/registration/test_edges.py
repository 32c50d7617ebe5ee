"""What is known of flat faces, their corners and their silhouettes: the parts that hold sharp bodies."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh

from picoradar import registration
from picoradar.registration.model import Surface, flat_faces
from picoradar.registration.refine import BeamFit, BeamFitter, annealed, edge_forgiving_likelihood
from picoradar.registration.refine.cast_beams import CastBeams
from picoradar.registration.robust.corners import Corners
from picoradar.registration.scan import NoiseModel, Scan, checked_scan
from picoradar.registration.se3 import pose, rotation_angle_deg, transform
from picoradar.registration.settings import EdgeSettings, RobustSettings

SIDES_MM = np.array([60.0, 50.0, 40.0])
SCANNER_MM = np.array([200.0, 300.0, 900.0])
SETTINGS = EdgeSettings()


def surface_of(mesh: trimesh.Trimesh) -> Surface:
    return registration.prepare_model(mesh.vertices, mesh.faces).surface


@pytest.fixture(scope="module")
def box() -> Surface:
    return surface_of(trimesh.creation.box(SIDES_MM))


def on_top(depth_mm: float) -> Scan:
    """A scan of the box's top, and of the sides that the scanner sees down to a depth, in the frame of the box."""
    mesh = trimesh.creation.box(SIDES_MM)
    points, faces = trimesh.sample.sample_surface(mesh, 4000, seed=1)
    seen = np.einsum("ij,ij->i", mesh.face_normals[faces], SCANNER_MM - points) > 0.0
    return checked_scan(points[seen & (points[:, 2] > SIDES_MM[2] / 2.0 - depth_mm)], origin=SCANNER_MM)


def test_each_face_of_a_box_has_its_four_corners(box: Surface) -> None:
    faces = flat_faces(box, SETTINGS)
    assert sorted(len(face.triangles) for face in faces) == [2] * 6
    found = {tuple(corner) for face in faces for corner in face.frames[:, 0, :3, 3].tolist()}
    assert found == set(itertools.product(*(SIDES_MM[:, None] / [-2.0, 2.0]).tolist()))
    for face in faces:
        assert face.frames.shape == (4, 2, 4, 4)
        rotations = face.frames[..., :3, :3]
        assert np.allclose(rotations @ rotations.swapaxes(-1, -2), np.eye(3))
        assert np.allclose(np.linalg.det(rotations), 1.0)
        assert np.allclose(rotations[..., 2], box.face_normals[face.triangles[0]])
        turns = np.einsum("ci,ci->c", rotations[:, 0, :, 0], rotations[:, 1, :, 0])
        assert np.allclose(turns, 0.0)  # one x axis along each of the edges that meet


@pytest.mark.parametrize(
    "round_body", [trimesh.creation.icosphere(subdivisions=3), trimesh.creation.cylinder(20.0, 50.0, sections=64)]
)
def test_what_is_round_has_no_corners(round_body: trimesh.Trimesh) -> None:
    assert flat_faces(surface_of(round_body), SETTINGS) == []


@pytest.mark.parametrize(("sides", "corners"), [(6, [4] * 6 + [6] * 2), (10, [4] * 10)])
def test_a_face_with_many_corners_is_left_out(sides: int, corners: list[int]) -> None:
    prism = surface_of(trimesh.creation.cylinder(20.0, 50.0, sections=sides))
    assert sorted(len(face.frames) for face in flat_faces(prism, SETTINGS)) == corners


def test_vertices_along_a_straight_edge_are_no_corners() -> None:
    finer = surface_of(trimesh.creation.box(SIDES_MM).subdivide())
    assert [len(face.frames) for face in flat_faces(finer, SETTINGS)] == [4] * 6


def test_faces_that_look_opposite_ways_in_one_plane_are_two() -> None:
    """The underside of one box lies in the plane of the other's top."""
    boxes = [trimesh.creation.box(SIDES_MM) for _ in range(2)]
    boxes[1].apply_translation([100.0, 7.0, SIDES_MM[2]])
    faces = flat_faces(surface_of(trimesh.util.concatenate(boxes)), SETTINGS)
    assert [len(face.triangles) for face in faces] == [2] * 12


def test_corners_of_a_box_brought_together_give_its_half_turns(box: Surface) -> None:
    scan = on_top(0.5)
    ends = Corners(scan, box, flat_faces(box, SETTINGS), SETTINGS).turned(np.eye(4))
    about_z = next(score for score, end in ends if np.allclose(end, np.diag([-1.0, -1.0, 1.0, 1.0])))
    upside_down = [score for score, end in ends if np.allclose(end, np.diag([1.0, -1.0, -1.0, 1.0]))]
    quarter = [score for score, end in ends if abs(rotation_angle_deg(end[:3, :3]) - 90.0) < 1e-6]
    assert about_z < 1e-9
    assert min(upside_down) < 1e-9
    assert min(quarter) > 0.1  # the top is no square, nor are the sides like it


def test_the_face_that_most_points_lie_on_is_laid_on_every_face() -> None:
    """Of a prism of three sides, the lid: two frames at each of its 3 corners, and at each of the body's 18."""
    mesh = trimesh.creation.cylinder(30.0, 40.0, sections=3)
    points, _ = trimesh.sample.sample_surface(mesh, 2000, seed=1)
    scan = checked_scan(points[points[:, 2] > 20.0 - 0.5], origin=[0.0, 0.0, 900.0])
    prism = surface_of(mesh)
    ends = Corners(scan, prism, flat_faces(prism, SETTINGS), SETTINGS).turned(np.eye(4))
    assert len(ends) == 2 * 3 * (3 * 4 + 2 * 3)
    lies_along = np.array([end[:3, 2] for _, end in ends]) @ prism.face_normals.T  # where the lid's normal comes to lie
    assert np.allclose(lies_along.max(axis=1), 1.0)


def test_a_scan_on_no_flat_face_brings_no_corners_together(box: Surface) -> None:
    assert Corners(on_top(0.5), box, [], SETTINGS).turned(np.eye(4)) == []


@pytest.mark.parametrize("shift", [(-0.6, 0.0, 0.0), (0.0, -0.6, 0.0), (-0.4, -0.4, 0.0)])
def test_points_that_overhang_a_silhouette_are_drawn_back(box: Surface, shift: tuple[float, float, float]) -> None:
    """The sides that they overhang face away from the scanner; the top that they were measured on does not."""
    scan = on_top(1e-6)
    start = pose(np.eye(3), np.array(shift))
    moved = annealed(scan, box, start, np.ones(len(scan), dtype=np.bool_), RobustSettings())
    overhang = np.abs(transform(moved, scan.points)[:, :2]) - SIDES_MM[:2] / 2.0
    assert overhang.max() < 0.25


def test_what_faces_away_draws_nothing(box: Surface) -> None:
    """Points of the top, begun under the box: its underside is nearest, and no beam comes from there."""
    scan = on_top(1e-6)
    start = pose(np.eye(3), np.array([0.0, 0.0, -SIDES_MM[2] - 0.5]))
    moved = annealed(scan, box, start, np.ones(len(scan), dtype=np.bool_), RobustSettings())
    assert np.abs(moved - start).max() < 1e-9


@pytest.mark.parametrize(("shift_mm", "forgiven"), [(0.05, True), (1.5, False)])
def test_only_beams_that_pass_an_edge_by_within_noise_are_forgiven(
    box: Surface, shift_mm: float, forgiven: bool
) -> None:
    """The whole top: slid by less than the noise over a side that faces away, some of its beams meet nothing."""
    x, y = np.meshgrid(np.linspace(-29.99, 29.99, 60), np.linspace(-24.99, 24.99, 20))
    scan = checked_scan(np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 20.0)]), origin=SCANNER_MM)
    everywhere, settings = np.ones(len(scan), dtype=np.bool_), RobustSettings()
    noise = NoiseModel.of(0.2, settings.noise)
    fitter = BeamFitter(scan, box, noise, scan.around, noise_known=True, settings=settings)
    beams, forgiving = [], []
    for shift in (0.0, -shift_mm):
        start = pose(np.eye(3), np.array([shift, 0.0, 0.0]))
        cast = CastBeams.at(scan, box, start, everywhere, settings.beam_fit, settings.tissue)
        fit = BeamFit(start, cast.met(cast.signed_mm), everywhere, noise, [], 0.0)
        beams.append(fitter.likelihood_at(start, noise, everywhere))
        forgiving.append(edge_forgiving_likelihood(fit, scan, box, everywhere, settings))
    assert (beams[0] - beams[1]) * len(scan) > 100.0  # nats, of the 20 points on that edge
    assert ((forgiving[0] - forgiving[1]) * len(scan) < settings.trust.plausible_nats) == forgiven
