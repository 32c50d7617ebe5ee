"""Seeded scenes of bodies with sharp edges, of which sparse strips may hold some motions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from picoradar import registration
from picoradar.registration.least_squares import information, plane_rows
from picoradar.registration.scan import NoiseModel, checked_scan
from picoradar.registration.se3 import (
    displacement_covariance,
    inverse,
    pose,
    rotation_angle_deg,
    rotation_from_vector,
    transform,
)
from picoradar.registration.settings import NoiseSettings

KINDS = ("box", "prism", "wedge", "cylinder with a flat", "cylinder with a key")
STARTS = ("truth", "near", "any")
NOISES_MM = (0.0, 0.05, 0.2, 0.4)
MIN_NOISE_MM = 0.02
"""Of points without noise, as it is given and in the floor: what the solver takes for the least of any instrument."""

LIMIT_DEG, LIMIT_MM = 1.0, 1.0
"""The clinic's tolerance."""

ALLOWED = 0.5
"""The floor allows a pass where the root mean square error that it predicts is under this share of the limits: twice
that is the error in 95 % of the cases, which the verdict goes by."""

SCENES_A_BODY = 5
"""Scenes in a row that share a body, for a model takes longer to prepare than a scene to be registered."""

FULL_TURN_SIDES = 180
"""Facets of a whole cylinder."""

GRAZING = 0.1
"""Smallest cosine between beam and normal that an echo comes back from: flatter, a spot is drawn out to ten times its
width, and its range means nothing."""

STRIP_MM = (0.3, 2.0)
"""Least and greatest width of the strips."""

AS_WELL_MM, AS_WELL_SHARE = 0.02, 0.1
"""A pose explains a scene as well as the true one where the points without noise lie so near to the model (root mean
square): this, and this share of the noise."""


@dataclass(frozen=True)
class Body:
    """A polygon (N, 2) pulled along z: model, rotations (S, 3, 3) that turn it into itself, and what curves.

    `round_mm` is the radius of the faces that stand for a cylinder; their edges hold nothing of a true one.
    """

    kind: str
    model: registration.Model
    symmetries: np.ndarray
    round_mm: float

    def normals(self, points: np.ndarray, flat: np.ndarray) -> np.ndarray:
        """Normals (N, 3) of the true body, from those of the facets."""
        radius = np.hypot(points[:, 0], points[:, 1])
        curved = (np.abs(radius - self.round_mm) < 0.02 * self.round_mm) & (np.abs(flat[:, 2]) < 0.5)
        curved &= np.einsum("ij,ij->i", flat[:, :2], points[:, :2]) > 0.999 * radius
        radial = np.column_stack([points[:, :2] / radius[:, None], np.zeros(len(points))])
        return np.where(curved[:, None], radial, flat)


@dataclass(frozen=True)
class Scene:
    """Points (N, 3) in the scanner frame, whose origin is the scanner, as measured and without noise."""

    seed: int
    body: Body
    strips: bool
    points: np.ndarray
    clean: np.ndarray
    noise_mm: float
    truth: np.ndarray
    start_name: str
    start: Any
    noise_given_mm: float | None
    floor_deg: float
    floor_mm: float

    @property
    def allowed(self) -> bool:
        """Whether the floor allows a pass, and no symmetry forbids it."""
        ambiguous = self.start_name == "any" and len(self.body.symmetries) > 1
        return self.floor_deg < ALLOWED * LIMIT_DEG and self.floor_mm < ALLOWED * LIMIT_MM and not ambiguous

    def ambiguous(self, found: registration.Registration) -> bool:
        """Whether a wrong pose among the result and its rivals explains the points without noise as well."""
        poses = [found.model_from_scanner, *(rival.model_from_scanner for rival in found.rivals)]
        enough = AS_WELL_MM + AS_WELL_SHARE * self.noise_mm
        for one in poses:
            turn, shift = self.errors(one)
            off = self.body.model.surface.distances(transform(one, self.clean))
            if (turn > LIMIT_DEG or shift > LIMIT_MM) and np.sqrt(np.mean(off**2)) < enough:
                return True
        return False

    def register(self) -> registration.Registration:
        """Register the scene by the public front door."""
        return registration.register(
            self.points, self.body.model, start=self.start, noise_mm=self.noise_given_mm, range_bias_mm=0.1
        )

    def errors(self, found: np.ndarray) -> tuple[float, float]:
        """Rotation in deg and the largest shift of a point in mm, of the nearest of the equivalent poses."""
        equivalent = [pose(turn, np.zeros(3)) @ self.truth for turn in self.body.symmetries]
        each = [
            (
                np.linalg.norm(transform(found, self.points) - transform(true, self.points), axis=1).max(),
                rotation_angle_deg(found[:3, :3] @ true[:3, :3].T),
            )
            for true in equivalent
        ]
        shift, turn = min(each)
        return float(turn), float(shift)


def outline(kind: str, rng: np.random.Generator) -> tuple[np.ndarray, list[np.ndarray], float]:
    """Corners (N, 2) counter-clockwise about the origin, half turns of the pulled body, radius of what is round."""
    a, b = rng.uniform(15.0, 40.0, 2)
    half_turns = [np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, -1.0]), np.diag([-1.0, -1.0, 1.0])]
    if kind == "box":
        return np.array([[-a, -b], [a, -b], [a, b], [-a, b]]), half_turns, np.inf
    if kind == "prism":
        angles = np.cumsum(rng.dirichlet([6.0, 6.0, 6.0]) * 2.0 * np.pi)
        return a * np.stack([np.cos(angles), np.sin(angles)], axis=1) * [1.0, b / a], [], np.inf
    if kind == "wedge":
        lean = rng.uniform(0.1, 0.8)
        return np.array([[-a, -b], [a, -b], [a, b * lean], [-a, b]]), [], np.inf
    angle = np.arange(FULL_TURN_SIDES) * 2.0 * np.pi / FULL_TURN_SIDES
    ring = a * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if kind == "cylinder with a flat":
        edge = rng.uniform(0.5, 0.9) * a
        kept = ring[:, 0] < edge
        side = np.sqrt(a * a - edge * edge)
        first = int(np.flatnonzero(kept)[0])
        return np.concatenate([[[edge, -side], [edge, side]], ring[first:][kept[first:]]]), half_turns[:1], a
    high, wide = a * rng.uniform(1.1, 1.4), a * rng.uniform(0.1, 0.3)
    foot = np.sqrt(a * a - wide * wide)
    kept = ring[(ring[:, 0] < 0.0) | (np.abs(ring[:, 1]) > wide)]
    return np.concatenate([[[foot, -wide], [high, -wide], [high, wide], [foot, wide]], kept]), half_turns[:1], a


@lru_cache(maxsize=2)
def make_body(kind: str, seed: int) -> Body:
    """A body of random sides."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    corners, half_turns, round_mm = outline(kind, rng)
    half, count = rng.uniform(10.0, 30.0), len(corners)
    around, after = np.arange(count), np.roll(np.arange(count), -1)
    low, high = np.column_stack([corners, np.full(count, -half)]), np.column_stack([corners, np.full(count, half)])
    vertices = np.concatenate([low, high, [[0.0, 0.0, -half], [0.0, 0.0, half]]])
    sides = [np.stack([around, after, after + count], 1), np.stack([around, after + count, around + count], 1)]
    lids = [np.stack([after, around, np.full(count, 2 * count)], 1)]
    lids += [np.stack([around + count, after + count, np.full(count, 2 * count + 1)], 1)]
    model = registration.prepare_model(vertices, np.concatenate(sides + lids), name=kind)
    return Body(kind, model, np.stack([np.eye(3), *half_turns]), round_mm)


def make_scene(seed: int) -> Scene:
    """The scene of a seed; seeds of one `SCENES_A_BODY` share their body."""
    rng = np.random.default_rng([seed, 1])
    body = make_body(KINDS[seed // SCENES_A_BODY % len(KINDS)], seed // SCENES_A_BODY)
    strips, rastered = rng.random() < 0.5, rng.random() < 0.5
    noise = float(rng.choice(NOISES_MM))
    while True:
        towards = rng.normal(size=3)
        scanner = towards / np.linalg.norm(towards) * rng.uniform(300.0, 1500.0)
        count = int(rng.uniform(300.0, 1500.0)) * (4 if strips else 1)
        at, flat = (_rastered if rastered else _sampled)(body, scanner, count, rng)
        echoed = np.einsum("ij,ij->i", flat, scanner - at) > GRAZING * np.linalg.norm(scanner - at, axis=1)
        at, flat = at[echoed], flat[echoed]
        if strips:
            at, flat = _stripped(at, flat, rng)
        if len(at) > 100:
            break
    normals = body.normals(at, flat)
    frame = pose(rotation_from_vector(_unit(rng) * rng.uniform(0.0, np.pi)), scanner)
    clean = transform(inverse(frame), at)
    beams = clean / np.linalg.norm(clean, axis=1, keepdims=True)
    points = clean + beams * rng.normal(0.0, 1.0, len(clean))[:, None] * noise
    start_name = STARTS[int(rng.integers(len(STARTS)))]
    off = pose(rotation_from_vector(_unit(rng) * np.radians(rng.uniform(0.0, 5.0))), np.zeros(3))
    middle = pose(np.eye(3), at.mean(axis=0))
    near = pose(np.eye(3), _unit(rng) * rng.uniform(0.0, 5.0)) @ middle @ off @ inverse(middle) @ frame
    start: Any = {"truth": frame, "near": near, "any": "any"}[start_name]
    given = max(noise, MIN_NOISE_MM) if rng.random() < 0.5 else None
    bound = floor(clean, frame, at, normals, noise)
    return Scene(seed, body, strips, points, clean, noise, frame, start_name, start, given, *bound)


def floor(
    clean: np.ndarray, frame: np.ndarray, at: np.ndarray, normals: np.ndarray, noise_mm: float
) -> tuple[float, float]:
    """Root mean square errors at the Cramer-Rao bound: rotation in deg, and in mm at the point that has most."""
    model = NoiseModel.of(max(noise_mm, MIN_NOISE_MM), NoiseSettings())
    sigma = model.plane_sigma(checked_scan(clean), frame[:3, :3], normals)
    centre = at.mean(axis=0)
    covariance = np.linalg.pinv(information(plane_rows(at, normals, centre), sigma), rcond=1e-12, hermitian=True)
    held = np.linalg.matrix_rank(information(plane_rows(at, normals, centre), sigma), tol=1e-3, hermitian=True)
    if held < 6:
        return np.inf, np.inf
    worst = max(np.trace(displacement_covariance(covariance, p - centre)) for p in at[:: max(1, len(at) // 50)])
    return float(np.degrees(np.sqrt(np.trace(covariance[:3, :3])))), float(np.sqrt(worst))


def _rastered(body: Body, scanner: np.ndarray, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Places (N, 3) that a square raster of beams meets, and normals of their facets; about `count` of them."""
    half = body.model.size_mm / 2.0 / np.linalg.norm(scanner)
    steps = np.linspace(-half, half, int(np.sqrt(2.0 * count)))
    x, y = np.meshgrid(steps, steps)
    back = -scanner / np.linalg.norm(scanner)
    across = np.linalg.svd(back[None])[2][1:]
    roll = rng.uniform(0.0, np.pi)
    across = np.array([[np.cos(roll), np.sin(roll)], [-np.sin(roll), np.cos(roll)]]) @ across
    beams = back + np.stack([x.ravel(), y.ravel()], axis=1) @ across
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    faces, distance = body.model.surface.cast(np.broadcast_to(scanner, beams.shape), beams)
    hit = faces >= 0
    return scanner + beams[hit] * distance[hit, None], body.model.surface.face_normals[faces[hit]]


def _sampled(body: Body, scanner: np.ndarray, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Places (N, 3) drawn evenly from what the scanner sees of the surface, on no raster."""
    surface = body.model.surface
    faces = rng.choice(len(surface.faces), 3 * count, p=surface.face_areas / surface.face_areas.sum())
    u, v = np.sort(rng.random((2, len(faces))), axis=0)
    shares = np.stack([u, v - u, 1.0 - v], axis=1)
    at = np.einsum("ni,nij->nj", shares, surface.vertices[surface.faces[faces]])
    distance = np.linalg.norm(at - scanner, axis=1)
    met, reach = surface.cast(np.broadcast_to(scanner, at.shape), (at - scanner) / distance[:, None])
    seen = (met >= 0) & (np.abs(reach - distance) < 1e-3)
    return at[seen], surface.face_normals[faces[seen]]


def _stripped(at: np.ndarray, flat: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Of the flat face that most points lie on all, of the others a strip beside it."""
    normals, counts = np.unique(flat.round(6), axis=0, return_counts=True)
    face = normals[int(np.argmax(counts))]
    depth = np.max(at @ face) - at @ face
    kept = depth < rng.uniform(*STRIP_MM)
    return at[kept], flat[kept]


def _unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)
