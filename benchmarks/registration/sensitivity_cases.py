"""Scans that settings are moved on: see ``sensitivity.py``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import synthetic_scans as synthetic
from sharp_scenes import KINDS, SCENES_A_BODY, make_scene

from picoradar.registration import Model, PreparationSettings, load_model, prepare_model
from picoradar.registration.se3 import pose, transform

BONE = Path(__file__).parents[2] / "sim" / "data" / "hip_right.stl"
TISSUE = (0.0, 0.3, 0.42, 0.6)
BLOCKS_APART = 4
"""Of so many seeds one has a scan of the small body: without a hollow a search takes 20 times as long."""


@dataclass(frozen=True)
class Case:
    """One scan with what it is registered to; `symmetries` (S, 4, 4) turn the body into itself."""

    body: str
    points: np.ndarray
    truth: np.ndarray
    targets: np.ndarray
    options: dict = field(default_factory=dict)
    symmetries: np.ndarray = field(default_factory=lambda: np.eye(4)[None])


def block() -> tuple[np.ndarray, np.ndarray]:
    """A wedge with three different edges and no symmetry: a whole body without a hollow, mm."""
    v = np.array([[0, 0, 0], [62, 0, 0], [62, 41, 0], [0, 41, 0], [9, 6, 27], [33, 11, 19], [25, 30, 34.0]])
    f = [[0, 2, 1], [0, 3, 2], [0, 1, 5], [0, 5, 4], [1, 2, 5], [2, 6, 5], [2, 3, 6], [3, 0, 4], [3, 4, 6], [4, 5, 6]]
    return v, np.array(f)


def cases(models: dict[str, Model], scans: int, first_seed: int) -> list[Case]:
    """All scans, the same on every run."""
    hip, body = models["hip"], models["block"]
    view = hip.views[0]
    targets = view.centre + np.concatenate([np.zeros((1, 3)), 30.0 * np.eye(3), -30.0 * np.eye(3)])
    out = []
    for seed in range(first_seed, first_seed + scans):
        for tissue in TISSUE:
            seen = synthetic.scan(hip, view.centre, view.axis, seed, tissue=tissue)
            out.append(Case("hip", seen.points, seen.truth, targets, {"grid": seen.grid}))
        seen = synthetic.scan(hip, view.centre, view.axis, seed + 10_000, tissue=0.42)
        start = synthetic.start_off(seen.truth, seen.points, 12.0, 10.0, seed)
        out.append(Case("hip", seen.points, seen.truth, targets, {"start": start}))
        seen = synthetic.scan(hip, view.centre, view.axis, seed + 20_000, tissue=0.42)
        out.append(Case("hip", seen.points, seen.truth, targets, {"response_mv": amplitudes(hip, seen, seed)}))
        if (seed - first_seed) % BLOCKS_APART:
            continue
        towards = np.array([0.3, -0.2, 0.93]) / np.linalg.norm([0.3, -0.2, 0.93])
        seen = synthetic.scan(body, body.centre, towards, seed + 30_000, tissue=0.0, coverage=1.0)
        corners = body.centre + 20.0 * np.concatenate([np.eye(3), -np.eye(3)])
        out.append(Case("block", seen.points, seen.truth, corners, {"grid": seen.grid}))
    return out


def amplitudes(model: Model, seen: synthetic.Synthetic, seed: int) -> np.ndarray:
    """Responses (N,) in mV: bone by its incidence, soft tissue a little over half of it, with 5 % of noise."""
    beams = seen.points / np.linalg.norm(seen.points, axis=1, keepdims=True)
    normals = model.closest(transform(seen.truth, seen.points)).normals
    cosine = np.clip(-np.einsum("ij,ij->i", normals, beams @ seen.truth[:3, :3].T), 0.0, 1.0)
    material = np.where(seen.height_mm > 0.0, 0.55, 1.0)
    return 60.0 * material * (0.3 + 0.7 * cosine) * np.random.default_rng([seed, 6]).normal(1.0, 0.05, len(cosine))


def prepared(settings: PreparationSettings) -> dict[str, Model]:
    """Both models, prepared with such settings."""
    bone = load_model(BONE)
    return {
        "hip": prepare_model(bone.vertices, bone.faces, settings=settings),
        "block": prepare_model(*block(), settings=settings),
    }


def sharp_cases(rounds: int, first_seed: int) -> tuple[list[Case], dict[str, Model]]:
    """Scenes of bodies with sharp edges, and their models: in a round, as many as a body has, of each kind of body."""
    taken: list[Case] = []
    models: dict[str, Model] = {}
    for seed in range(first_seed, first_seed + rounds * len(KINDS) * SCENES_A_BODY):
        scene = make_scene(seed)
        name = f"{scene.body.kind} {seed // SCENES_A_BODY}"
        models[name] = scene.body.model
        middle = transform(scene.truth, scene.points).mean(axis=0)
        targets = middle + 20.0 * np.concatenate([np.eye(3), -np.eye(3)])
        options = {"start": scene.start, "noise_mm": scene.noise_given_mm}
        twins = np.stack([pose(turn, np.zeros(3)) for turn in scene.body.symmetries])
        taken.append(Case(name, scene.points, scene.truth, targets, options, twins))
    return taken, models
