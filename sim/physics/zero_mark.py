"""`zero_mark`: a small plate at a known range in a corner of the field, by which a radar checks its range zero."""

from __future__ import annotations

import numpy as np

from picoradar.sim.physics.materials import paint
from picoradar.sim.physics.mirrors import Beam
from picoradar.sim.physics.scene import Target

PAINT = paint(0.3)  # at 675 mm its echo is about as high as the reference, and stays on the A/D at any drive voltage


def zero_mark(beam: Beam, path_mm: float, side_mm: float) -> Target:
    """Get a square plate across a beam, in the scanner's own frame.

    Parameters
    ----------
    beam : Beam
        The ray that meets its middle.
    path_mm : float
        From mirror 1 to the plate, along the beam.
    side_mm : float
        Of the square, one side along x.

    Returns
    -------
    Target
        Two triangles of matt gray paint. Its post stands behind it, out of every beam.
    """
    middle = beam.origin + (path_mm - beam.path_mm) * beam.direction
    across = np.cross([0.0, 1.0, 0.0], beam.direction)
    across /= np.linalg.norm(across)
    up = np.cross(beam.direction, across)
    half = side_mm / 2
    corners = np.array([middle + half * (x * across + y * up) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    faces = np.array([(0, 1, 2), (0, 2, 3)], dtype=np.int64)
    return Target("zero mark", corners, faces, (PAINT,), np.zeros(2, dtype=np.int64))
