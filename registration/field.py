"""Signed distance field of a surface: exact near it, first order far away, read in nanoseconds a point.

Every node holds distance and gradient (float32); between nodes the value follows to first order from the nearest node.
A 1 mm field errs by about 0.03 mm rms near bone; the last step of a registration is exact and does not use it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from registration._types import FloatArray
from registration.surface import Surface

Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True)
class DistanceField:
    """A regular grid of distances and gradients.

    Attributes
    ----------
    low : (3,) array
        First node, mm, in the frame of the view that holds the field.
    step_mm : float
    shape : tuple of three ints
    nodes : (n, 4) array of float32
        Signed distance and its gradient, C order over `shape`.
    """

    low: FloatArray
    step_mm: float
    shape: tuple[int, int, int]
    nodes: Float32Array

    def sample(self, points: Float32Array) -> tuple[Float32Array, Float32Array]:
        """Read the field at `points` (3, ...) mm, given by coordinate.

        Returns
        -------
        distance : (...) array of float32
            Signed, mm; outside the grid that of the nearest node, continued to first order.
        gradient : (..., 3) array of float32
        """
        scale = np.float32(1.0 / self.step_mm)
        distance, flat = np.zeros((), dtype=np.float32), np.zeros((), dtype=np.int32)
        offsets = []
        for axis in range(3):
            grid = points[axis] * scale
            grid -= np.float32(self.low[axis] * scale)
            node = np.rint(grid)
            np.clip(node, np.float32(0.0), np.float32(self.shape[axis] - 1), out=node)
            grid -= node
            offsets.append(grid)
            flat = flat * np.int32(self.shape[axis]) + node.astype(np.int32)
        record = self.nodes.take(flat, axis=0)
        distance = offsets[0] * record[..., 1]
        distance += offsets[1] * record[..., 2]
        distance += offsets[2] * record[..., 3]
        distance *= np.float32(self.step_mm)
        distance += record[..., 0]
        return distance, record[..., 1:]


def build_fields(
    surface: Surface,
    low: FloatArray,
    high: FloatArray,
    *,
    step_mm: float = 1.0,
    band_mm: float = 1.75,
) -> tuple[DistanceField, DistanceField]:
    """Build a fine field of `step_mm` and a coarse one of twice that over one box.

    Parameters
    ----------
    surface : Surface
    low, high : (3,) arrays
        Corners of the box, mm.
    step_mm : float
    band_mm : float
        Half width of the band about the surface in which the fine nodes are exact, twice that for the coarse ones;
        outside it, nodes follow to first order from a field of four times the step, exact everywhere.
    """
    fields: list[DistanceField] = []
    for factor in (4, 2, 1):
        step = step_mm * factor
        shape = [int(np.ceil((high[k] - low[k]) / step)) + 1 for k in range(3)]
        axes = [low[k] + step * np.arange(shape[k]) for k in range(3)]
        points = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)
        nodes = np.empty((points.shape[1], 4), dtype=np.float32)
        near = np.ones(points.shape[1], dtype=np.bool_)
        if fields:
            nodes[:, 0], nodes[:, 1:] = fields[-1].sample(points.astype(np.float32))
            near = np.abs(nodes[:, 0]) < band_mm * factor
        found = surface.closest(np.ascontiguousarray(points.T[near]))
        nodes[near, 0], nodes[near, 1:] = found.signed_mm, found.normals
        fields.append(DistanceField(low=low, step_mm=step, shape=(shape[0], shape[1], shape[2]), nodes=nodes))
    return fields[2], fields[1]
