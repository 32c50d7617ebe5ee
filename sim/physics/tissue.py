"""A socket during an operation: wet bone, fat pad, clot, torn tissue, blood, and retractors beside it."""

from __future__ import annotations

import math

import numpy as np

from picoradar.sim.physics.materials import BLOOD, BONE_WET, CARTILAGE_ON_BONE, CLOT, FAT, SOFT_TISSUE, STEEL, Material
from picoradar.sim.physics.scene import FloatArray, Target

SOCKET_RADIUS_MM = 25.5
SOCKET_AREA_MM2 = 2700.0
FOSSA_MM = (-91.88, 35.81, -68.73)  # deepest point of the fossa, seen along the axis of the socket
CLOT_MM = 2.0
WALL_MM, CARTILAGE_MM = 4.0, 1.5  # tissue lies on the fossa too, cartilage does not


def decorate(bone: Target, centre: FloatArray, axis: FloatArray) -> Target:
    """Decorate a bone as in the patient of the dissertation (chapter 5).

    It becomes wet, with cartilage on the wall of the socket, fat and a clot in its fossa, and two retractors beside it.

    Parameters
    ----------
    bone : Target
        The bone.
    centre, axis : (3,) arrays
        Centre of the socket (mm) and its opening direction, in the bone's frame.

    Returns
    -------
    Target
    """
    wall = (_wall_areas(bone, centre, CARTILAGE_MM) > 0).astype(np.int64)
    wet = Target(bone.name, bone.vertices, bone.faces, (BONE_WET, CARTILAGE_ON_BONE), wall)
    floor = np.array(FOSSA_MM)
    pad = _lump(floor - 0.5 * axis, axis, (6.0, 5.0, 1.5), 0.0, FAT)
    clot = _lump(floor + 0.9 * axis, axis, (CLOT_MM / 2, CLOT_MM / 2, 0.4), 0.0, CLOT)
    across = np.cross(axis, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    blades = [_blade(centre + side * 30.0 * across, across, axis) for side in (-1.0, 1.0)]
    for part in (pad, clot, *blades):
        wet = wet.joined(part)
    return wet


def add_tissue(bone: Target, centre: FloatArray, share: float, rng: np.random.Generator) -> Target:
    """Put clumps of soft tissue, torn strands and blood on the wall of the socket (dissertation, section 4.3).

    Parameters
    ----------
    bone : Target
        The bone.
    centre : (3,) array
        Centre of the socket, mm.
    share : float
        Share of the socket's area to cover.
    rng : numpy.random.Generator
        Chooses places, sizes and kinds.

    Returns
    -------
    Target

    Raises
    ------
    ValueError
        When the bone has no wall of a socket near the centre.
    """
    corners = bone.vertices[bone.faces]
    weights = _wall_areas(bone, centre, WALL_MM)
    if not weights.any():
        raise ValueError(f"target {bone.name}: no wall of a socket near {centre.round(1).tolist()} to put tissue on")
    covered = 0.0
    while covered < share * SOCKET_AREA_MM2:
        face = int(rng.choice(len(weights), p=weights / weights.sum()))
        kind = rng.random()
        if kind < 0.5:
            size, material = rng.uniform((1.5, 1.5, 1.0), (4.0, 4.0, 4.0)), SOFT_TISSUE
        elif kind < 0.8:
            size, material = rng.uniform((4.0, 0.5, 0.5), (9.0, 1.2, 3.0)), SOFT_TISSUE
        else:
            size, material = rng.uniform((1.5, 1.5, 0.2), (4.0, 4.0, 0.5)), BLOOD
        a, b, c = corners[face]
        bone = bone.joined(_lump((a + b + c) / 3, np.cross(b - a, c - a), size, rng.uniform(0, math.pi), material))
        covered += math.pi * float(size[0] * size[1])
    return bone


def _wall_areas(bone: Target, centre: FloatArray, margin_mm: float) -> FloatArray:
    """Twice the area of each face (F,) that looks to the centre from the socket's radius, zero for all others."""
    corners = bone.vertices[bone.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = corners.mean(axis=1) - centre
    distance = np.linalg.norm(outward, axis=1)
    on_wall = (np.abs(distance - SOCKET_RADIUS_MM) < margin_mm) & (np.einsum("ij,ij->i", outward, normals) < 0)
    return np.where(on_wall, np.linalg.norm(normals, axis=1), 0.0)


def _frame(z: FloatArray, turn_rad: float) -> FloatArray:
    """Columns: two directions across ``z``, turned about it, and ``z``."""
    z = z / np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    return np.column_stack(
        [math.cos(turn_rad) * x + math.sin(turn_rad) * y, math.cos(turn_rad) * y - math.sin(turn_rad) * x, z]
    )


def _lump(
    middle: FloatArray, upward: FloatArray, size: FloatArray | tuple[float, ...], turn_rad: float, material: Material
) -> Target:
    """Ellipsoid with half axes ``size`` (two along the surface, one upward)."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices = (np.asarray(ball.vertices) * np.asarray(size)) @ _frame(upward, turn_rad).T + middle
    return _part(vertices, np.array(ball.faces), material)


def _blade(middle: FloatArray, flat: FloatArray, along: FloatArray) -> Target:
    """Blade of a retractor: 2 mm thick along ``flat``, 18 mm wide, 40 mm deep along ``along``."""
    import trimesh

    box = trimesh.creation.box((2.0, 18.0, 40.0))
    z = along / np.linalg.norm(along)
    frame = np.column_stack([flat, np.cross(z, flat), z])
    return _part(np.asarray(box.vertices) @ frame.T + middle + 15.0 * z, np.array(box.faces), STEEL)


def _part(vertices: FloatArray, faces: np.ndarray, material: Material) -> Target:
    return Target("part", vertices, faces.astype(np.int64), (material,), np.zeros(len(faces), dtype=np.int64))
