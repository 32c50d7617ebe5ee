"""Rays on bodies, and where the bodies stand."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.sim.operator import clicks
from picoradar.sim.physics import (
    SOCKET_AXIS,
    SOCKET_CENTRE_MM,
    WHITE,
    Noise,
    Scene,
    Target,
    build_scene,
    hip,
    landmarks,
    load_target,
    place_target,
)
from picoradar.sim.physics.materials import BONE_MOIST, CLOT, GRAY_PAINT, STEEL, Material, backscatter, paint
from picoradar.sim.physics.rays import MISS, NumpyCaster, caster
from picoradar.sim.physics.targets import prism
from picoradar.sim.settings import SimulationSettings

ALONG_Z = np.array([[0.0, 0.0, 1.0]])


def placed(name, distance_mm=900.0, pose=None, seed=1):
    target = load_target(name)
    return Scene(target, place_target(target, distance_mm, pose, Noise(seed).stream("scene.pose")))


@settings(deadline=None, max_examples=50)
@given(st.floats(-60, 60), st.floats(-60, 60), st.floats(300, 1400))
def test_hit_on_a_tilted_plane_is_exact(rx_deg, ry_deg, distance_mm):
    scene = placed("plate", pose=(0.0, 0.0, distance_mm, rx_deg, ry_deg, 0.0))
    hits = scene.cast(np.array([[0.3, -0.2, 0.0]]), ALONG_Z)
    normal = scene.scanner_from_model[:3, 2]
    expected = distance_mm + (normal[0] * -0.3 + normal[1] * 0.2) / normal[2]
    assert hits.distance_mm[0] == pytest.approx(expected, abs=1e-9)
    assert hits.cosine[0] == pytest.approx(abs(normal[2]), abs=1e-12)


def test_a_face_reflects_from_both_sides_and_a_miss_is_told():
    flat = Material(0.4, roughness_deg=0.0)
    corners = np.array([[-1.0, -1, 5], [1, -1, 5], [0, 1, 5]])
    target = Target("one", corners, np.array([[0, 1, 2]]), (flat,), np.array([0]))
    turned = Target("other", corners, np.array([[2, 1, 0]]), (flat,), np.array([0]))
    for body in (target, turned):
        hits = Scene(body, np.eye(4)).cast(np.zeros((2, 3)), np.vstack([ALONG_Z, -ALONG_Z]))
        np.testing.assert_array_equal(hits.distance_mm, [5.0, np.inf])
        np.testing.assert_array_equal(hits.face, [0, MISS])
        np.testing.assert_allclose(hits.brightness, [0.4, 0.0])


def test_plain_numpy_finds_the_same_faces_as_embree():
    body = prism()
    corners = body.vertices[body.faces]
    rng = np.random.default_rng(7)
    directions = rng.normal(size=(300, 3)).astype(np.float32)
    origins = (rng.uniform(-15, 15, (300, 3)) - 60 * directions).astype(np.float32)
    by_numpy = NumpyCaster(corners).run(origins, directions)
    assert 50 < np.count_nonzero(by_numpy != MISS) < 300
    np.testing.assert_array_equal(by_numpy, caster(corners).run(origins, directions))


def test_a_body_without_area_is_refused():
    flat = Target("flat", np.zeros((3, 3)), np.array([[0, 1, 2]]), (WHITE,), np.array([0]))
    with pytest.raises(ValueError, match="triangle with an area"):
        Scene(flat, np.eye(4))


def returned(material, angles_deg):
    cosine = np.cos(np.radians(angles_deg))
    return backscatter(cosine, np.tile(material.coefficients(), (len(cosine), 1)))


def test_rough_surface_keeps_its_brightness_at_grazing_incidence():
    angles = np.array([0.0, 60.0, 80.0])
    np.testing.assert_allclose(returned(Material(1.0, roughness_deg=0.0), angles), np.cos(np.radians(angles)))
    rough = returned(paint(0.5), angles)
    assert np.all(np.diff(rough) < 0)
    assert rough[2] / rough[0] > 0.5


def test_metal_flashes_at_normal_incidence_only():
    at_normal, tilted = returned(STEEL, np.array([0.0, 30.0]))
    assert at_normal > 1.0
    assert tilted < 0.2


@settings(deadline=None, max_examples=50)
@given(st.floats(0.0, 89.9), st.sampled_from([BONE_MOIST, STEEL, GRAY_PAINT, CLOT]))
def test_nothing_returns_less_than_nothing(angle_deg, material):
    value = returned(material, np.array([angle_deg]))[0]
    assert 0.0 <= value <= material.diffuse + material.specular


def test_step_is_ten_millimetres():
    hits = placed("step").cast(np.array([[5.0, 0, 0], [-5.0, 0, 0]]), np.vstack([ALONG_Z] * 2))
    assert sorted(hits.distance_mm) == pytest.approx([890.0, 900.0])


def test_gray_wedge_goes_from_dark_to_bright():
    x_mm = np.arange(-18.0, 19.0, 4.0)
    origins = np.stack([x_mm, np.zeros(10), np.zeros(10)], axis=1)
    levels = placed("gray").cast(origins, np.repeat(ALONG_Z, 10, axis=0)).brightness
    assert levels.max() / levels.min() > 10
    assert np.all(np.diff(levels) != 0)


def test_sphere_is_where_it_should_be():
    hits = placed("sphere").cast(np.zeros((1, 3)), ALONG_Z)
    assert hits.distance_mm[0] == pytest.approx(875.0, abs=0.01)


def test_prism_shows_its_two_faces_at_63_deg_to_the_beam():
    assert trimesh.Trimesh(prism().vertices, prism().faces).is_watertight
    scene = placed("prism")
    hits = scene.cast(np.array([[-10.0, 0, 0], [10.0, 0, 0], [0.01, 0, 0]]), np.repeat(ALONG_Z, 3, axis=0))
    np.testing.assert_allclose(np.degrees(np.arccos(hits.cosine[:2])), 63.435, atol=1e-3)
    assert hits.distance_mm[2] == pytest.approx(880.02)
    np.testing.assert_allclose(hits.distance_mm[:2], 900.0)


def test_socket_constants_fit_the_mesh():
    bone = hip()
    mesh = trimesh.Trimesh(bone.vertices, bone.faces, process=False)
    outward = mesh.triangles_center - SOCKET_CENTRE_MM
    radius = np.linalg.norm(outward, axis=1)
    wall = (np.abs(radius - 25.5) < 2.0) & (np.einsum("ij,ij->i", outward / radius[:, None], mesh.face_normals) < -0.85)
    area = mesh.area_faces[wall]
    assert area.sum() > 2500.0
    assert np.average(radius[wall], weights=area) == pytest.approx(25.5, abs=0.2)
    normal = (area[:, None] * mesh.face_normals[wall]).sum(axis=0)
    angle_deg = np.degrees(np.arccos(normal @ SOCKET_AXIS / np.linalg.norm(normal) / np.linalg.norm(SOCKET_AXIS)))
    assert angle_deg < 2.0


@pytest.mark.parametrize("seed", range(1, 7))
def test_the_raster_covers_the_socket(seed):
    scene = placed("hip", seed=seed)
    x_mm, y_mm = np.mgrid[-19.5:20:3, -19.5:20:3].reshape(2, -1)
    aim = np.stack([x_mm, y_mm, np.full_like(x_mm, 900.0)], axis=1)
    hits = scene.cast(np.zeros_like(aim), aim / np.linalg.norm(aim, axis=1, keepdims=True))
    points = aim / 900.0 * hits.distance_mm[:, None] * 900.0 / np.linalg.norm(aim, axis=1, keepdims=True)
    centre = scene.scanner_from_model[:3, :3] @ SOCKET_CENTRE_MM + scene.scanner_from_model[:3, 3]
    radius = np.linalg.norm(points - centre, axis=1)
    assert np.mean(np.abs(radius - 25.5) < 4.5) > 0.85  # wall or fossa
    axis = scene.scanner_from_model[:3, :3] @ SOCKET_AXIS
    assert -axis[2] > np.cos(np.radians(15.1))  # compared as cosines: rounding takes an exact one beyond 1


def test_landmarks_lie_on_the_bone_far_apart_and_in_sight():
    points = np.array([*landmarks("hip").values()])
    bone = hip()
    _, distance, _ = trimesh.proximity.closest_point_naive(trimesh.Trimesh(bone.vertices, bone.faces), points)
    assert distance.max() < 0.05
    apart = np.linalg.norm(points[[0, 1, 2]] - points[[1, 2, 0]], axis=1)
    assert apart.min() > 20.0
    for seed in range(1, 7):
        scene = placed("hip", seed=seed)
        pose = scene.scanner_from_model
        seen = points @ pose[:3, :3].T + pose[:3, 3]
        far = np.linalg.norm(seen, axis=1)
        hits = scene.cast(np.zeros((3, 3)), seen / far[:, None])
        np.testing.assert_allclose(hits.distance_mm, far, atol=0.5)
        assert np.abs(seen[:, :2]).max() < 32.0


def test_clicks_are_a_few_millimetres_off():
    points = np.array([*landmarks("hip").values()])
    pose = np.eye(4)
    pose[:3, 3] = 1, 2, 3
    errors = np.array([clicks(points, pose, Noise(n).stream("clicks")) - points - [1, 2, 3] for n in range(200)])
    assert errors.std() == pytest.approx(2.5, abs=0.2)
    assert abs(errors.mean()) < 0.2


def test_other_bodies_have_no_landmarks():
    with pytest.raises(ValueError, match="no landmarks"):
        landmarks("plate")


def test_a_mesh_file_takes_its_pose_as_it_is(tmp_path):
    path = tmp_path / "box.stl"
    trimesh.creation.box((20, 20, 20)).export(path)
    target = load_target(str(path))
    pose = place_target(target, 900.0, (1.0, 2.0, 800.0, 0.0, 0.0, 90.0), Noise(1).stream("scene.pose"))
    np.testing.assert_allclose(pose, [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 800], [0, 0, 0, 1]], atol=1e-12)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "neither a body"),
        (b"", "no readable mesh|no triangles"),
        (b"solid x\nendsolid x\n", "no readable mesh|no triangles"),
        (b"this is no mesh at all", "no readable mesh|no triangles"),
    ],
)
def test_a_file_that_is_no_mesh_is_refused(tmp_path, content, message):
    path = tmp_path / "thing.stl"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=message):
        load_target(str(path))


def test_a_text_file_with_a_name_in_latin_1_is_read(tmp_path):
    path = tmp_path / "hip.stl"
    body = trimesh.creation.box((20, 20, 20))
    path.write_bytes(body.export(file_type="stl_ascii").encode().replace(b"solid", b"solid H\xfcfte", 1))
    assert np.ptp(load_target(str(path)).vertices, axis=0).tolist() == [20, 20, 20]


def test_a_mesh_in_metres_or_with_nan_is_refused(tmp_path):
    small = tmp_path / "small.stl"
    trimesh.creation.box((0.02, 0.02, 0.02)).export(small)
    with pytest.raises(ValueError, match="metres"):
        load_target(str(small))
    broken = tmp_path / "broken.obj"
    broken.write_text("v 0 0 0\nv 10 0 0\nv 0 nan 0\nf 1 2 3\n")
    with pytest.raises(ValueError, match="NaN"):
        load_target(str(broken))


def look_into_the_socket(scene, step_mm=1.0):
    x_mm, y_mm = np.mgrid[-18.0:18.01:step_mm, -18.0:18.01:step_mm].reshape(2, -1)
    aim = np.stack([x_mm, y_mm, np.full_like(x_mm, 900.0)], axis=1)
    return scene.cast(np.zeros_like(aim), aim / np.linalg.norm(aim, axis=1, keepdims=True))


def test_surgery_leaves_a_clot_without_echo_and_fat_in_the_fossa():
    decorated = build_scene(SimulationSettings(surgical=True), Noise(1))
    bare = build_scene(SimulationSettings(), Noise(1))
    seen = look_into_the_socket(decorated, 0.5)
    dark = seen.brightness < 0.05
    assert 1.0 < dark.sum() * 0.25 < 6.0  # mm^2
    nearer = look_into_the_socket(bare, 0.5).distance_mm - seen.distance_mm
    assert 0.5 < nearer.max() < 4.0
    assert nearer.min() > -1e-6


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_tissue_covers_about_its_share_of_the_socket(share):
    scenes = [build_scene(SimulationSettings(tissue_share=s), Noise(3)) for s in (0.0, share)]
    bare, covered = (look_into_the_socket(scene).distance_mm for scene in scenes)
    off = np.abs(bare - covered) > 0.05
    assert 0.5 * share < off.mean() < 1.5 * share
    assert np.median((bare - covered)[off]) > 0.3


def test_only_the_hip_can_be_dressed():
    with pytest.raises(ValueError, match="hip only"):
        build_scene(SimulationSettings(target="plate", surgical=True), Noise(1))
