"""Bones made into CT-like volumes and back into surfaces, to know what a model from a volume is worth.

    python benchmarks/registration/volumes.py --bone hip.stl --spacing 0.6,0.6,2 --binary

prints the error of the surface that comes back: its offset (mean) and its random part about the socket.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first
import scenes  # noqa: E402
from scipy.ndimage import gaussian_filter  # noqa: E402
from success import Bone  # noqa: E402

from picoradar.registration import Model, prepare_model  # noqa: E402

REACH_MM = 42.0
"""Half the edge of the cube about the socket that is made into a volume."""

PSF_MM = 0.7
"""Standard deviation of the scanner's point spread."""

NOISE_SHARE = 60.0 / 840.0
"""Noise of a voxel over the contrast of bone: 60 HU of 840."""

BINARY_BLUR_MM = 0.7
"""Standard deviation of the filter that smooths the steps of a binary mask."""


@dataclass(frozen=True)
class Volume:
    """How a bone is made into a volume: edges of a voxel (3,) in mm, and whether a mask is kept instead of grey."""

    spacing_mm: tuple[float, float, float]
    binary: bool

    @property
    def name(self) -> str:
        """For tables."""
        x, y, z = self.spacing_mm
        size = f"{x:g} mm" if x == y == z else f"{x:g} x {y:g} x {z:g} mm"
        return f"volume {size}, {'binary' if self.binary else 'graded'}"


VOLUMES = (Volume((1, 1, 1), False), Volume((1, 1, 1), True), Volume((0.6, 0.6, 2), False))


def filled(model: Model, volume: Volume, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Share of bone (X, Y, Z) in each voxel about the frame's origin, and the first voxel's centre (3,)."""
    h = np.array(volume.spacing_mm)
    rng = np.random.default_rng([seed, 5])
    count = np.ceil(2.0 * REACH_MM / h).astype(int) + 1
    first = -REACH_MM + rng.uniform(-0.5, 0.5, 3) * h  # no grid lies well
    axes = [first[k] + h[k] * np.arange(count[k]) for k in range(3)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    near = model.closest(places)
    across = np.abs(near.normals) @ h  # how far a voxel reaches along the normal: the width of its partial volume
    share = np.clip(0.5 - near.signed_mm / across, 0.0, 1.0).reshape(count)
    grey = gaussian_filter(share, PSF_MM / h) + rng.normal(0.0, NOISE_SHARE, count)
    if volume.binary:
        return gaussian_filter((grey > 0.5).astype(float), BINARY_BLUR_MM / h), first
    return grey, first


def made_again(model: Model, volume: Volume, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The surface of a closed model about the frame's origin, as a volume shows it, turned as the model's is."""
    vertices, faces = scenes.contoured(*filled(model, volume, seed), volume.spacing_mm, 0.5)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    agree = np.einsum("ij,ij->i", normals, model.closest((a + b + c) / 3.0).normals)
    return vertices, faces if np.median(agree) > 0.0 else faces[:, ::-1].copy()


def surface_error(model: Model, vertices: np.ndarray, radius_mm: float) -> tuple[float, float]:
    """Mean of the surface's distance from the model about the socket, and its random part, mm."""
    near = vertices[np.linalg.norm(vertices, axis=1) < 1.3 * radius_mm]
    off = model.closest(near).signed_mm
    return float(off.mean()), float(off.std())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bone", default="procedural", help="procedural or FILE, with *x,y,z to stretch it")
    parser.add_argument("--spacing", default="1,1,1", help="edges of a voxel, mm")
    parser.add_argument("--binary", action="store_true", help="a mask, not grey values")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    bone = Bone.of(options.bone)
    model = prepare_model(*bone.models["whole"])
    x, y, z = (float(v) for v in options.spacing.split(","))
    volume = Volume((x, y, z), options.binary)
    vertices, faces = made_again(model, volume, options.seed)
    offset, random = surface_error(model, vertices, bone.scale * scenes.CUP_RADIUS)
    print(f"{volume.name}: {len(faces)} faces, offset {offset:+.3f} mm, random {random:.3f} mm")


if __name__ == "__main__":
    main()
