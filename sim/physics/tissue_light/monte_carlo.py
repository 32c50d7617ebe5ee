"""Monte Carlo of light in a scattering half-space, seen along the beam; and the script that makes the shipped table.

    python -m picoradar.sim.physics.tissue_light.monte_carlo --out tissue_light.npz     # some ten minutes

With isotropic scattering of the reduced coefficient mu_s', everything scales: lengths enter as mu_s' times length, and
absorption is the factor exp(-mu_a path). So one run for each refractive index and angle of incidence serves all
materials. Isotropic scattering with reduced coefficients is exact for late light and an approximation for the
earliest (Guo 2002, J. Quant. Spectrosc. Radiat. Transf. 73, 159).
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

INDICES = (1.33, 1.37, 1.40, 1.44, 1.50, 1.55)
ANGLES_DEG = (0.0, 30.0, 45.0, 60.0, 75.0)
PATH_EDGES = np.concatenate([[0.0], np.geomspace(0.02, 1000.0, 95)])  # in units of 1 / mu_s'
RADIUS_EDGES = np.concatenate([[0.0], np.geomspace(0.05, 200.0, 43), [np.inf]])
SEED, PHOTONS, BATCH = 904, 600_000, 50_000
VERSION = 1


def fresnel(cosine: FloatArray, ratio: float) -> FloatArray:
    """Get the reflectance of unpolarised light at a step of the refractive index.

    Parameters
    ----------
    cosine : (N,) array
        Cosine of the angle of incidence, 0 to 1.
    ratio : float
        Index of the side that the light comes from, over that of the other side.
    """
    sine_behind = ratio * np.sqrt(1.0 - cosine * cosine)
    behind = np.sqrt(np.maximum(1.0 - sine_behind * sine_behind, 0.0))
    across = (ratio * cosine - behind) / (ratio * cosine + behind)
    along = (cosine - ratio * behind) / (cosine + ratio * behind)
    return np.asarray(np.where(sine_behind < 1.0, 0.5 * (across * across + along * along), 1.0))


class Scattered(NamedTuple):
    """What the receiver sees of one scattering of each photon: ``weight`` (N,), its part of the radiance factor;
    ``path`` (N,) in the medium and ``radius`` (N,) from the beam, both in units of 1 / mu_s'."""

    weight: FloatArray
    path: FloatArray
    radius: FloatArray


def follow(index: float, angle_deg: float, photons: int, rng: np.random.Generator) -> Iterator[Scattered]:
    """Follow photons of a pencil beam until they leave the half-space, one scattering of all of them at a time.

    At each scattering a share of 1 / (4 pi) sr goes back along the refracted line of sight, of which exp(-way) arrives
    at the surface: the receiver looks along the beam, so nobody has to wait for a photon that leaves that way.

    Parameters
    ----------
    index : float
        Refractive index of the medium, in air.
    angle_deg : float
        Angle of incidence in air.
    photons : int
    rng : numpy.random.Generator

    Yields
    ------
    Scattered
        ``path`` includes the way in air from the point where the light leaves to the wave front through the point
        where it came in, as a path in the medium that takes as long; ``radius`` is measured across the beam.
    """
    sine, cosine = math.sin(math.radians(angle_deg)), math.cos(math.radians(angle_deg))
    sine_in = sine / index
    cosine_in = math.sqrt(1.0 - sine_in**2)
    passed = 1.0 - float(fresnel(np.array([cosine]), 1.0 / index)[0])
    scale = passed * passed / (4.0 * index**2 * cosine_in) / photons
    x, y, z, path = np.zeros((4, photons))
    ux, uy, uz = np.full(photons, sine_in), np.zeros(photons), np.full(photons, cosine_in)
    while len(x):
        step = rng.standard_exponential(len(x))
        x, y, z, path = x + step * ux, y + step * uy, z + step * uz, path + step
        out = z < 0
        kept = path < PATH_EDGES[-1]
        kept[out] &= rng.random(int(out.sum())) < fresnel(-uz[out], index)
        x, y, z, path = x[kept], y[kept], np.abs(z[kept]), path[kept]

        back = z / cosine_in
        aside = x - back * sine_in
        seen = path + back + aside * (sine / index)
        yield Scattered(scale * np.exp(-back), seen, np.hypot(aside * cosine, y))

        uz = rng.uniform(-1.0, 1.0, len(z))
        turn = rng.uniform(0.0, 2 * math.pi, len(z))
        level = np.sqrt(1.0 - uz * uz)
        ux, uy = level * np.cos(turn), level * np.sin(turn)


def kernel(index: float, angle_deg: float, photons: int, rng: np.random.Generator) -> FloatArray:
    """Get the radiance factor (paths, radii) of a pencil beam in the bins of `PATH_EDGES` and `RADIUS_EDGES`."""
    paths, radii = len(PATH_EDGES) - 1, len(RADIUS_EDGES) - 1
    sums = np.zeros(paths * radii)
    for scattered in follow(index, angle_deg, photons, rng):
        column = np.searchsorted(RADIUS_EDGES, scattered.radius, side="right") - 1
        row = np.searchsorted(PATH_EDGES, scattered.path, side="right") - 1
        inside = row < paths
        sums += np.bincount(row[inside] * radii + column[inside], scattered.weight[inside], len(sums))
    return sums.reshape(paths, radii)


def make_table(photons: int, seed: int) -> FloatArray:
    """Get the kernels (indices, angles, paths, radii) of all refractive indices and angles."""
    table = np.zeros((len(INDICES), len(ANGLES_DEG), len(PATH_EDGES) - 1, len(RADIUS_EDGES) - 1))
    batches = math.ceil(photons / BATCH)
    for i, index in enumerate(INDICES):
        for j, angle_deg in enumerate(ANGLES_DEG):
            for batch in range(batches):
                rng = np.random.default_rng([seed, i, j, batch])
                table[i, j] += kernel(index, angle_deg, BATCH, rng) / batches
    return table


def main() -> None:
    """Make the table and write it with what it was made of."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--photons", type=int, default=PHOTONS, help="for each index and angle; rounded up to batches")
    parser.add_argument("--seed", type=int, default=SEED)
    asked = parser.parse_args()
    made_of = {"version": VERSION, "seed": asked.seed, "photons": asked.photons, "batch": BATCH}
    np.savez_compressed(
        asked.out,
        kernel=make_table(asked.photons, asked.seed).astype(np.float32),
        indices=np.array(INDICES),
        angles_deg=np.array(ANGLES_DEG),
        path_edges=PATH_EDGES,
        radius_edges=RADIUS_EDGES,
        made_of=np.array(json.dumps(made_of)),
    )


if __name__ == "__main__":
    main()
