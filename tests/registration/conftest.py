"""A hip-like socket made by formula, and scans of it, so that these tests need no file from outside."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration.se3 import pose, rotation_from_vector

SHARED = Path(__file__).parents[2].parent / "shared"


def _smooth(low: float, high: float, x: np.ndarray) -> np.ndarray:
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def socket_mesh(rings: int = 60, spokes: int = 120) -> tuple[np.ndarray, np.ndarray]:
    """A closed cup opening towards +z: radius 26 mm, a fossa, a notch towards -y and an uneven rim."""
    phi = 2.0 * np.pi * np.arange(spokes) / spokes
    notch = 1.0 - _smooth(18.0, 30.0, np.degrees(np.abs(np.arctan2(np.sin(phi + np.pi / 2), np.cos(phi + np.pi / 2)))))
    opening = np.radians(86.0 + 4.0 * np.cos(2 * phi + 0.5) + 3.0 * np.cos(3 * phi - 0.8) - 14.0 * notch)
    fraction = np.arange(1, rings + 1) / rings
    theta = fraction[:, None] * opening
    direction = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta)], axis=-1
    )  # (rings, spokes, 3)
    fossa_axis = np.array([0.08, -np.sin(0.35), -np.cos(0.35)])
    angle = np.degrees(np.arccos(np.clip(direction @ fossa_axis / np.linalg.norm(fossa_axis), -1.0, 1.0)))
    angle = angle * (1.0 + 0.1 * np.cos(3 * phi + 0.6))
    depth = np.maximum(1.0 - _smooth(28.0, 37.0, angle), 0.85 * notch * _smooth(22.0, 34.0, np.degrees(theta)))
    inner = 26.0 + 3.6 * depth + 0.25 * np.cos(2 * phi + 0.4) * np.sin(theta) ** 2
    outer = 35.0 + 2.0 * np.cos(2 * phi + 1.0) * np.sin(theta) ** 2 + 1.5 * np.cos(phi) * np.sin(theta)
    vertices = [np.array([[0.0, 0.0, -29.6]]), (inner[..., None] * direction).reshape(-1, 3)]
    vertices += [(outer[::-1][..., None] * direction[::-1]).reshape(-1, 3), np.array([[0.0, 0.0, -35.0]])]
    total = 2 * rings
    index = 1 + np.arange(total * spokes).reshape(total, spokes)
    a, b = index[:-1], np.roll(index, -1, axis=1)[:-1]
    c, d = np.roll(index, -1, axis=1)[1:], index[1:]
    faces = [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    first, last = index[0], index[-1]
    faces.append(np.stack([np.zeros(spokes, int), np.roll(first, -1), first], axis=1))
    faces.append(np.stack([np.full(spokes, total * spokes + 1), last, np.roll(last, -1)], axis=1))
    return np.concatenate(vertices), np.concatenate(faces)


@dataclass(frozen=True)
class SimulatedScan:
    points: np.ndarray
    truth: np.ndarray
    landmarks: list[dict[str, object]]
    grid: np.ndarray


@pytest.fixture(scope="session", autouse=True)
def cache_of_the_run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Prepared models go to a folder of this run, never to the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PICORADAR_CACHE", str(tmp_path_factory.mktemp("models")))
        yield


@pytest.fixture(scope="session")
def socket() -> registration.Model:
    return registration.prepare_model(*socket_mesh(), name="socket")


@pytest.fixture(scope="session")
def scan_of() -> Callable[..., SimulatedScan]:
    """Scan the model along its +z axis from 900 mm with an n x n raster, noise along the beam."""

    def scan(model: registration.Model, seed: int, *, n: int = 40, noise_mm: float = 0.35) -> SimulatedScan:
        rng = np.random.default_rng(seed)
        tilt, azimuth, roll = np.radians(rng.uniform(0, 12)), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)
        back = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
        x = np.cross([0.3, 1.0, 0.2], -back)
        x /= np.linalg.norm(x)
        rotation = np.stack([x, np.cross(-back, x), -back], axis=1) @ rotation_from_vector(np.array([0, 0, roll]))
        truth = pose(rotation, 900.0 * back)
        steps = (np.arange(n) - (n - 1) / 2) * (56.0 / n) / 900.0
        gx, gy = np.meshgrid(steps, steps)
        beams = np.stack([gx.ravel(), gy.ravel(), np.ones(gx.size)], axis=1)
        beams /= np.linalg.norm(beams, axis=1, keepdims=True)
        surface = model.surface
        origins = np.broadcast_to(truth[:3, 3], beams.shape).copy()
        face, distance, _ = surface.tree.intersect_ray_first(
            surface.vertices, surface.faces, origins, np.ascontiguousarray(beams @ rotation.T)
        )
        hit = face >= 0
        clean = beams[hit] * distance[hit, None]
        noisy = clean + beams[hit] * rng.normal(0.0, noise_mm, hit.sum())[:, None]
        picks = [int(np.argmax(clean @ v)) for v in ([1, 0, 0], [-0.5, 0.8, 0], [-0.5, -0.8, 0])]
        landmarks: list[dict[str, object]] = [
            {
                "scanner": clean[i],
                "model": truth[:3, :3] @ clean[i] + truth[:3, 3] + rng.normal(0, 2.0, 3),
                "name": f"rim {k}",
            }
            for k, i in enumerate(picks)
        ]
        rows, columns = np.divmod(np.flatnonzero(hit), n)
        return SimulatedScan(noisy, truth, landmarks, np.stack([rows, columns], axis=1))

    return scan


@pytest.fixture(scope="session")
def shared_bone() -> Path:
    """A real hip bone that the repository does not hold."""
    path = SHARED / "data" / "vsd-z013-hip" / "z013_Hip_R.stl"
    if not path.is_file():
        pytest.skip(reason=f"{path} is not here: tests on that bone are not run")
    return path
