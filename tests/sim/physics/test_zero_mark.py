"""The mark of the range zero: where it stands, and what does not touch it."""

from __future__ import annotations

import numpy as np
import pytest

from picoradar.sim import SimulatedBench
from picoradar.sim.physics import Scene
from picoradar.sim.physics.materials import Material

AWAY = {"target": "plate", "distance_mm": 1000.0}


def to_mark(bench: SimulatedBench, side_mm: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Origin and direction of the ray that meets the mark so far beside its middle (along x)."""
    beam = bench.mirrors.ray(np.radians(bench.settings.zero_mark_deg))
    across = np.cross([0.0, 1.0, 0.0], beam.direction)
    return beam.origin + side_mm * across / np.linalg.norm(across), beam.direction


def material_of(scene: Scene, face: np.ndarray) -> Material:
    """Material of the face that the first ray hits."""
    return scene.material(int(scene.material_numbers(face)[0]))


@pytest.mark.parametrize("place_deg", [(4.3, 4.3), (-4.0, 3.0), (0.0, -4.9)])
def test_the_beam_of_its_place_meets_it_square_at_its_range(place_deg: tuple[float, float]) -> None:
    with SimulatedBench({**AWAY, "zero_mark_deg": place_deg, "zero_mark_mm": 660.0}) as bench:
        origin, direction = to_mark(bench)
        hits = bench.scene.cast(origin[None], direction)
        path_mm = bench.mirrors.ray(np.radians(place_deg)).path_mm
        assert path_mm + hits.distance_mm[0] == pytest.approx(660.0 + bench.settings.mirror_separation_mm, abs=1e-9)
        assert hits.cosine[0] == pytest.approx(1.0)
        assert material_of(bench.scene, hits.face).diffuse == 0.3


def test_beside_it_the_beam_goes_on_to_the_target() -> None:
    with SimulatedBench(AWAY) as bench:
        for side_mm, on_it in ((-5.1, False), (-4.9, True), (4.9, True), (5.1, False)):
            origin, direction = to_mark(bench, side_mm)
            hits = bench.scene.cast(np.stack([origin, origin]), direction)
            assert (hits.distance_mm < 700.0).tolist() == [on_it, on_it], side_mm
            assert (material_of(bench.scene, hits.face).diffuse == 0.3) is on_it


def test_the_target_s_motion_and_paint_leave_it_alone() -> None:
    with SimulatedBench({**AWAY, "reflectance": 0.1}) as bench:
        origin, direction = to_mark(bench)
        still, moved = (bench.scene.cast(origin[None], direction, nearer_mm) for nearer_mm in (0.0, 15.0))
        assert moved.distance_mm[0] == still.distance_mm[0]
        assert material_of(bench.scene, still.face).diffuse == 0.3
        straight = np.zeros((1, 3)), np.array([0.0, 0.0, 1.0])
        far, near = (bench.scene.cast(*straight, nearer_mm).distance_mm[0] for nearer_mm in (0.0, 15.0))
        assert far - near == pytest.approx(15.0)


def test_a_target_before_it_hides_it() -> None:
    with SimulatedBench({"target": "plate", "distance_mm": 600.0}) as bench:
        origin, direction = to_mark(bench)
        assert bench.scene.cast(origin[None], direction).distance_mm[0] < 615.0


def test_it_is_no_part_of_the_model_and_can_be_left_out() -> None:
    with SimulatedBench({"target": "hip"}) as bench, SimulatedBench({"target": "hip", "zero_mark_mm": 0.0}) as bare:
        assert len(bench.target.faces) == len(bench.bare_target.faces) == len(bare.target.faces)
        origin, direction = to_mark(bench)
        assert np.isinf(bare.scene.cast(origin[None], direction).distance_mm[0])


def test_elsewhere_the_scene_is_as_without_it() -> None:
    with SimulatedBench(AWAY) as bench:
        bare = Scene(bench.target, bench.scene.scanner_from_model)
        rng = np.random.default_rng(5)
        for angles in np.radians(rng.uniform(-5.0, 3.5, (100, 2))):
            beam = bench.mirrors.ray(angles)
            one, other = (scene.cast(beam.origin[None], beam.direction) for scene in (bench.scene, bare))
            assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
