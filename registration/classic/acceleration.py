"""Besl and McKay's acceleration of ICP: when steps keep their direction, jump along it.

Reference: Besl, McKay, PAMI 14:239 (1992), section IV-C.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from picoradar.registration._types import FloatArray
from picoradar.registration.se3 import pose

MAX_ANGLE_DEG = 10.0
"""Successive steps that differ by less are taken for one direction."""

MAX_JUMP = 25.0
"""Largest jump, in lengths of the last step."""


@dataclass
class Accelerator:
    """Follows the poses of an ICP run and proposes jumps.

    Attributes
    ----------
    centre : (3,) array
        Centroid of the points, scanner frame, mm: poses are compared by where it goes.
    length_mm : float
        Size of the object, which makes angles comparable with shifts.
    """

    centre: FloatArray
    length_mm: float
    vectors: list[FloatArray] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)

    def add(self, solution: FloatArray, error: float) -> None:
        """Note a pose (4, 4) and its mean square error."""
        from scipy.spatial.transform import Rotation

        quaternion = Rotation.from_matrix(solution[:3, :3]).as_quat(canonical=True)
        if self.vectors and quaternion @ self.vectors[-1][:4] < 0:
            quaternion = -quaternion
        moved = solution[:3, :3] @ self.centre + solution[:3, 3]
        self.vectors.append(np.concatenate([2.0 * self.length_mm * quaternion, moved]))
        self.errors.append(error)

    def forget(self) -> None:
        """Begin again, after a jump."""
        self.vectors, self.errors = self.vectors[-1:], self.errors[-1:]

    def proposal(self) -> FloatArray | None:
        """A pose (4, 4) further along, or None when the steps do not keep their direction."""
        if len(self.vectors) < 4:
            return None
        q = self.vectors[-4:]
        steps = [q[k + 1] - q[k] for k in range(3)]
        sizes = [float(np.linalg.norm(step)) for step in steps]
        if min(sizes) == 0.0:
            return None
        cosines = [float(steps[k] @ steps[k + 1]) / (sizes[k] * sizes[k + 1]) for k in range(2)]
        if min(cosines) < np.cos(np.radians(MAX_ANGLE_DEG)):
            return None
        v = np.array([0.0, -sizes[2], -(sizes[2] + sizes[1])])
        jump = self._length(v, np.array(self.errors[:-4:-1]), MAX_JUMP * sizes[2])
        return None if jump is None else self._pose(q[3] + jump * steps[2] / sizes[2])

    @staticmethod
    def _length(v: FloatArray, errors: FloatArray, max_length: float) -> float | None:
        """Length of the jump from a line and a parabola through the last errors."""
        slope, offset = np.polyfit(v, errors, 1)
        a, b, _ = np.polyfit(v, errors, 2)
        line = -offset / slope if slope != 0.0 else np.inf
        parabola = -b / (2.0 * a) if a != 0.0 else np.inf
        if 0.0 < parabola < line < max_length or 0.0 < parabola < max_length < line:
            return float(parabola)
        if (
            0.0 < line < parabola < max_length
            or 0.0 < line < max_length < parabola
            or (parabola < 0.0 < line < max_length)
        ):
            return float(line)
        if line > max_length and parabola > max_length:
            return max_length
        return None

    def _pose(self, vector: FloatArray) -> FloatArray:
        from scipy.spatial.transform import Rotation

        rotation = np.asarray(Rotation.from_quat(vector[:4]).as_matrix(), dtype=np.float64)
        return pose(rotation, vector[4:] - rotation @ self.centre)
