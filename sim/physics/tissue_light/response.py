"""`time_response`: how late, and how much, of the light that enters a material comes back to the receiver."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.tissue_light.optical import Optical

FloatArray = NDArray[np.float64]

TABLE_FILE = Path(__file__).parents[2] / "data" / "tissue_light.npz"
VACUUM_MM_PER_PS = 0.299792458
POINTS_IN_BIN = 8  # radii in each bin of the table at which the share in view is taken
LEFT_OUT = 1e-4  # share of the light that may come later than the end of a response: 0.01 ps of a delay of 100 ps


class Table(NamedTuple):
    """Kernels (indices, angles, paths, radii) of a pencil beam, in units of 1 / mu_s' (`monte_carlo`)."""

    kernel: FloatArray
    indices: FloatArray
    angles_deg: FloatArray
    path_edges: FloatArray
    radius_edges: FloatArray

    def at(self, index: float, angle_deg: float) -> FloatArray:
        """Get the kernel (paths, radii) between the tabulated ones; beyond the ends that of the end."""
        i, u = _place(self.indices, index)
        j, v = _place(self.angles_deg, angle_deg)
        low, high = ((1 - v) * self.kernel[k, j] + v * self.kernel[k, j + 1] for k in (i, i + 1))
        return np.asarray((1 - u) * low + u * high)


class TimeResponse(NamedTuple):
    """Light that comes back from a material: its radiance factor ``beta``, and when: shares ``weight`` (N,) of it, of
    sum 1, at ``delay_ps`` (N,) after the light of the surface."""

    beta: float
    delay_ps: FloatArray
    weight: FloatArray


@lru_cache(maxsize=1)
def shipped_table() -> Table:
    """Read the table that ships with the simulator."""
    with np.load(TABLE_FILE) as stored:
        return Table(*(np.asarray(stored[name], dtype=np.float64) for name in Table._fields))


def time_response(optical: Optical, angle_deg: float, view_mm: float, spot_mm: float) -> TimeResponse:
    """Get the response of a thick piece of material to a short pulse.

    Parameters
    ----------
    optical : Optical
    angle_deg : float
        Angle of incidence.
    view_mm : float
        Radius of the disc across the beam that the receiver sees; inf for all light.
    spot_mm : float
        Radius of the evenly lit spot in the middle of it; 0 for a pencil beam. A Gaussian spot of the same diameter
        (1/e^2) has the same second moments.
    """
    table = shipped_table()
    scale = optical.scattering_per_mm
    share = _in_view(table.radius_edges, view_mm * scale, spot_mm * scale)
    path_mm = 0.5 * (table.path_edges[1:] + table.path_edges[:-1]) / scale
    beta = (table.at(optical.index, angle_deg) @ share) * np.exp(-optical.absorption_per_mm * path_mm)
    total = float(beta.sum())
    return TimeResponse(total, path_mm * (optical.index / VACUUM_MM_PER_PS), beta / total)


def on_grid(response: TimeResponse, step_ps: float, surface_share: float = 0.0) -> NDArray[np.float32]:
    """Get a response (N,) of sum 1 on a grid of times from 0, with the same mean delay.

    Parameters
    ----------
    response : TimeResponse
    step_ps : float
        Step of the grid.
    surface_share : float
        Share of the echo that the surface reflects at once.
    """
    counted = int(np.searchsorted(np.cumsum(response.weight), 1.0 - LEFT_OUT)) + 1
    places = response.delay_ps[:counted] / step_ps
    weight = response.weight[:counted] * ((1.0 - surface_share) / response.weight[:counted].sum())
    entries = places.astype(np.intp)
    between = places - entries
    grid = np.zeros(entries[-1] + 2)
    np.add.at(grid, entries, weight * (1.0 - between))
    np.add.at(grid, entries + 1, weight * between)
    grid[0] += surface_share
    return grid.astype(np.float32)


def _place(grid: FloatArray, value: float) -> tuple[int, float]:
    """Entry of a rising grid before a value, and how far between it and the next one (0 to 1)."""
    entry = min(max(int(np.searchsorted(grid, value)) - 1, 0), len(grid) - 2)
    return entry, float(np.clip((value - grid[entry]) / (grid[entry + 1] - grid[entry]), 0.0, 1.0))


def _in_view(edges: FloatArray, view: float, spot: float) -> FloatArray:
    """Share of the light in each bin of radii that leaves within the view, averaged over the spot where it came in."""
    if math.isinf(view):
        return np.ones(len(edges) - 1)
    steps = (np.arange(POINTS_IN_BIN) + 0.5) / POINTS_IN_BIN
    radii = edges[:-2, None] + steps * np.diff(edges[:-1])[:, None]
    shares = (radii <= view).astype(np.float64) if spot == 0 else _overlap(radii, view, spot) / (math.pi * spot**2)
    return np.append(shares.mean(axis=1), 0.0)


def _overlap(apart: FloatArray, a: float, b: float) -> FloatArray:
    """Area that two discs of radii a and b share, their centres ``apart``: two segments of a circle."""
    d = np.clip(apart, abs(a - b) + 1e-12, a + b)  # inside these, one in the other; beyond, none
    ahead = np.clip((d * d + a * a - b * b) / (2 * d * a), -1.0, 1.0)
    behind = np.clip((d * d + b * b - a * a) / (2 * d * b), -1.0, 1.0)
    kite = np.sqrt(np.maximum((-d + a + b) * (d + a - b) * (d - a + b) * (d + a + b), 0.0))
    return np.asarray(a * a * np.arccos(ahead) + b * b * np.arccos(behind) - 0.5 * kite)
