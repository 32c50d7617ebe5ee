"""Signed distance field of a surface: exact near it, first order far away, read in nanoseconds a point.

Every node holds distance and gradient (float32); between nodes the value follows to first order from the nearest node.
A 1 mm field errs by about 0.03 mm rms near bone; the last step of a registration is exact and does not use it. Beyond
the border of an open model nothing is known of bone: there the distance is positive and the gradient nil, so that
points are neither drawn to the border nor count as inside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picoradar.registration._types import Float32Array, FloatArray
from picoradar.registration.model.surface import Surface


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
        x, y, z = (int(np.ceil((high[k] - low[k]) / step)) + 1 for k in range(3))
        nodes = _halved(fields[-1], (x, y, z)) if fields else np.zeros((x * y * z, 4), dtype=np.float32)
        near = np.flatnonzero(np.abs(nodes[:, 0]) < band_mm * factor)
        places = np.stack(np.unravel_index(near, (x, y, z)), axis=1)
        found = surface.closest(low + step * places)
        beyond = surface.beyond_border(found)
        nodes[near, 0] = np.where(beyond, np.abs(found.signed_mm), found.signed_mm)
        nodes[near, 1:] = np.where(beyond[:, None], 0.0, found.normals)
        fields.append(DistanceField(low=low, step_mm=step, shape=(x, y, z), nodes=nodes))
    return fields[2], fields[1]


def _halved(field: DistanceField, shape: tuple[int, int, int]) -> Float32Array:
    """Nodes (n, 4) at half the step over `shape`, from those on both sides of them, axis after axis.

    Between two nodes the distance is that of the cubic through their values and slopes (Hermite), the gradient is the
    mean of theirs.
    """
    step = np.float32(field.step_mm)
    nodes = field.nodes.reshape(*field.shape, 4)
    for axis in range(3):
        given = np.moveaxis(nodes, axis, 0)
        halved = np.empty((shape[axis], *given.shape[1:]), dtype=np.float32)
        even, odd = halved[0::2], halved[1::2]
        even[:] = given[: len(even)]
        before, after = given[: len(odd)], given[1 : len(odd) + 1]
        np.add(before, after, out=odd)
        odd *= np.float32(0.5)
        odd[..., 0] += (before[..., 1 + axis] - after[..., 1 + axis]) * (step / np.float32(8.0))
        nodes = np.moveaxis(halved, 0, axis)
    return np.ascontiguousarray(nodes).reshape(-1, 4)
