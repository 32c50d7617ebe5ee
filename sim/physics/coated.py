"""`coated`: a flat piece of bone or tissue with paint on one half, to measure how much too far the bare half reads."""

from __future__ import annotations

import numpy as np

from picoradar.sim.physics.materials import BONE_MOIST, BONE_SPONGY, CARTILAGE, FAT, GRAY_PAINT, SOFT_TISSUE, Material
from picoradar.sim.physics.scene import Target
from picoradar.sim.settings import SampleMaterial

HALF_LENGTH_MM, HALF_WIDTH_MM, THICKNESS_MM = 20.0, 10.0, 16.0  # thicker than light of any weight comes back from

SAMPLES: dict[SampleMaterial, Material] = {
    "bone": BONE_MOIST,
    "cancellous": BONE_SPONGY,
    "cartilage": CARTILAGE,
    "fat": FAT,
    "muscle": SOFT_TISSUE,
}


def coated(material: SampleMaterial = "bone", coat_mm: float = 0.1) -> Target:
    """Get a flat piece of 40 x 20 mm, 16 mm thick, its half at positive x under gray matt paint.

    Parameters
    ----------
    material : str
        Of the piece.
    coat_mm : float
        Thickness of the paint. It is opaque: of light in paint of 150 / mm and this gray, exp(-4) is left after
        0.05 mm, and as much again on the way back.

    Returns
    -------
    Target
        Bare half in the plane z = 0, paint at z = ``coat_mm``, with a straight edge along y between them. Put straight
        in front of the scanner, the paint lies at its negative x.
    """
    x, y = HALF_LENGTH_MM, HALF_WIDTH_MM
    bare = _box((-x, -y, -THICKNESS_MM), (0.0, y, 0.0), SAMPLES[material])
    below = _box((0.0, -y, -THICKNESS_MM), (x, y, 0.0), SAMPLES[material])
    paint = _box((0.0, -y, 0.0), (x, y, coat_mm), GRAY_PAINT)
    return bare.joined(below).joined(paint)


def _box(low: tuple[float, float, float], high: tuple[float, float, float], material: Material) -> Target:
    import trimesh

    box = trimesh.creation.box(bounds=np.array([low, high]))
    faces = np.array(box.faces, dtype=np.int64)
    return Target("coated", np.asarray(box.vertices), faces, (material,), np.zeros(len(faces), dtype=np.int64))
