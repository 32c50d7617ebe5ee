"""First hits: Embree and libigl's tree find the same places."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from picoradar.registration.model import Surface
from picoradar.registration.model.rays import EmbreeRays, TreeRays, first_hits

OFFSET_MM = np.array([4000.0, -9000.0, 2500.0])


@pytest.fixture
def ball() -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=25.0)
    return Surface(np.asarray(mesh.vertices) + OFFSET_MM, np.asarray(mesh.faces))


def beams(count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    origins = OFFSET_MM + np.array([0.0, 0.0, 900.0]) + rng.normal(0.0, 30.0, (count, 3))
    aims = OFFSET_MM + rng.uniform(-40.0, 40.0, (count, 3)) - origins
    return origins, aims / np.linalg.norm(aims, axis=1, keepdims=True)


def test_embree_and_the_tree_meet_the_same_places(ball: Surface) -> None:
    pytest.importorskip("embreex")
    corners = ball.vertices[ball.faces[:, 0]]
    origins, directions = beams(4000)
    (near, near_mm), (exact, exact_mm) = (
        first_hits(rays, origins, directions, corners, ball.face_normals)
        for rays in (EmbreeRays(ball.vertices, ball.faces), TreeRays(ball.vertices, ball.faces, ball.tree))
    )
    same = near == exact  # on an edge either neighbour is right
    assert same.mean() > 0.998
    np.testing.assert_allclose(near_mm[same], exact_mm[same], rtol=0, atol=1e-9)
    assert 0.2 < (exact < 0).mean() < 0.8
    assert np.isinf(exact_mm[exact < 0]).all()


def test_a_hit_lies_on_the_ball(ball: Surface) -> None:
    origins, directions = beams(500)
    faces, distances = ball.cast(origins, directions)
    met = faces >= 0
    radius = np.linalg.norm(origins[met] + distances[met, None] * directions[met] - OFFSET_MM, axis=1)
    assert (radius <= 25.0 + 1e-6).all()
    assert (radius > 24.9).all()
