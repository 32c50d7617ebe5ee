"""Which points are neighbours: from the raster's rows and columns, found again in the beams where they are not given.

A cloud that went through a file has lost its rows and columns, but its beams still lie on a lattice. Two short steps
between neighbours and a least-squares fit that grows outward bring them back at a small part of the cost of a search
for nearest neighbours, which remains for clouds that never were a raster.
"""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import FloatArray, IntArray, Neighbours
from picoradar.registration.errors import PointsError
from picoradar.registration.se3 import frame_about

ANCHORS = 7
"""Points whose surroundings show the steps of a raster."""

GROWTH = 8
"""The fit of a lattice grows by this factor each time."""

FIRST_REACH = 3
"""Steps about the middle of a lattice that its first fit reaches."""

MAX_OFF_LATTICE = 0.3
"""Beams farther than this share of a step from their place are no raster."""

MIN_AHEAD = 0.1
"""Smallest cosine between a beam and the mean of all."""

MAX_SPARSITY = 16
"""A raster with more places for each point than this is none."""

MAX_SPACINGS = 2.3
"""Of the eight nearest points, those within so many typical spacings are neighbours."""

MAX_PLACES, MAX_GIVEN_SPARSITY = 10_000_000, 64
"""A given raster may have so many places, or so many for each point: tables of that size are made."""

MIN_ACROSS, MIN_LENGTH = 0.5, 0.5
"""The second step of a lattice makes at least 30 deg (its sine) with the first, and is at least half as long."""

MIN_SINE, MAX_CONDITION = 1e-3, 1e12
"""Steps more parallel than this, or a fit worse conditioned, span no lattice."""

SINGULAR = 0.5
"""Normal matrices of whole numbers have whole determinants: below this they are nil."""

MIN_EVENNESS, MAX_EVENNESS = 0.5, 1.5
"""A coarser lattice holds this share of the points that it should, or it is not even."""

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
"""Slant of the coarser lattice: the ratio that is hardest to approach by whole numbers spreads it most evenly."""


def neighbours(beams: FloatArray, grid: IntArray | None) -> Neighbours:
    """Indices (N, 8) of each point's neighbours; N stands for "none there".

    Parameters
    ----------
    beams : (N, 3) array
        Unit directions.
    grid : (N, 2) array of int or None
        Rows and columns; without them the nearest beams are the neighbours.
    """
    return _nearest(beams) if grid is None else _adjacent(grid)


def found_grid(beams: FloatArray) -> IntArray | None:
    """Rows and columns (N, 2) of beams (N, 3) that lie on a lattice, square or not; None where they lie on none."""
    place = _flat(beams)
    steps = None if place is None else _steps(place)
    if place is None or steps is None:
        return None
    first = place[:, int(np.argmin((place**2).sum(axis=0)))]
    reach, covered = FIRST_REACH, False
    while True:
        at = np.linalg.solve(steps, place - first[:, None])
        grid = np.rint(at)
        if covered:
            break
        farthest = np.abs(grid).max(axis=0)
        near = np.flatnonzero(farthest <= reach)
        rows = np.vstack([grid[:, near], np.ones(len(near))])
        normal = rows @ rows.T
        if np.linalg.cond(normal) > MAX_CONDITION:
            return None
        solution = np.linalg.solve(normal, rows @ place[:, near].T)
        steps, first = solution[:2].T, solution[2]
        if abs(np.linalg.det(steps)) < MIN_SINE * (steps**2).sum():
            return None
        reach, covered = reach * GROWTH, len(near) == len(beams)
    grid -= grid.min(axis=1)[:, None]
    rows_and_columns = grid.max(axis=1) + 1.0
    if np.abs(at - np.rint(at)).max() > MAX_OFF_LATTICE or rows_and_columns.prod() > MAX_SPARSITY * len(beams):
        return None
    found = grid.astype(np.int64)
    taken = np.bincount(found[0] * int(rows_and_columns[1]) + found[1])
    return np.ascontiguousarray(found.T) if taken.max() == 1 else None


def checked_grid(grid: IntArray) -> IntArray:
    """Rows and columns (N, 2) from 0 on, a common stride of theirs taken out.

    Raises
    ------
    PointsError
        If they span far more places than there are points.
    """
    place = grid - grid.min(axis=0)
    place //= np.maximum(np.gcd.reduce(place, axis=0), 1)
    rows, columns = (int(n) + 1 for n in place.max(axis=0))
    if rows * columns > max(MAX_PLACES, MAX_GIVEN_SPARSITY * len(grid)) or place.min() < 0:
        raise PointsError(
            f"grid spans {rows} rows and {columns} columns for {len(grid)} points: give their places in the raster, "
            "counted in steps, or leave it out"
        )
    return np.asarray(place, dtype=np.int64)


def thinned(grid: IntArray, every: int) -> tuple[IntArray, IntArray] | None:
    """One in `every` points, evenly spread: the points of a coarser lattice within the raster.

    Parameters
    ----------
    grid : (N, 2) array of int
    every : int
        At least 1.

    Returns
    -------
    chosen : (M,) array of int
        Indices, ascending.
    rows and columns : (M, 2) array of int
        In the coarser lattice. None where the points leave out so many places, or just those, that the coarser lattice
        holds less than half of what it should, or more than half too many.
    """
    slant = max(1, round(GOLDEN * every)) % every
    chosen = np.flatnonzero((grid[:, 0] + slant * grid[:, 1]) % every == 0)
    if not MIN_EVENNESS < len(chosen) * every / len(grid) < MAX_EVENNESS:
        return None
    steps = _reduced(np.array([every, 0]), np.array([-slant, 1]))
    coarse = np.rint(grid[chosen] @ np.linalg.inv(steps.astype(np.float64))).astype(np.int64)
    return chosen, coarse


def _reduced(a: IntArray, b: IntArray) -> IntArray:
    """Shortest basis (2, 2) of the lattice of two steps (Lagrange)."""
    while True:
        if a @ a > b @ b:
            a, b = b, a
        multiple = round(float(a @ b) / float(a @ a))
        if multiple == 0:
            return np.stack([a, b])
        b = b - multiple * a


def _flat(beams: FloatArray) -> FloatArray | None:
    """Places (2, N) of the beams on a plane across their mean; None where some hardly go that way."""
    mean = beams.mean(axis=0)
    length = float(np.linalg.norm(mean))
    if length < MIN_AHEAD:
        return None
    x, y, ahead = frame_about(mean / length).T @ beams.T
    return np.stack([x / ahead, y / ahead]) if ahead.min() > MIN_AHEAD else None


def _steps(place: FloatArray) -> FloatArray | None:
    """Two short steps between neighbours, the columns of (2, 2), that span a lattice; None where all are parallel."""
    count = place.shape[1]
    if count < 4 * ANCHORS:
        return None
    surroundings = []
    for anchor in np.linspace(0, count - 1, ANCHORS + 2).astype(np.int64)[1:-1]:
        x, y = place - place[:, anchor, None]
        distance = x * x + y * y
        near = np.argpartition(distance, 8)[:9]
        near = near[distance[near] > 0.0]
        if len(near) < 8:
            return None  # two beams at one place
        surroundings.append(np.stack([x[near], y[near]]))
    between = np.stack(surroundings)
    square = (between**2).sum(axis=1)
    typical = int(np.argsort(square.min(axis=1), kind="stable")[ANCHORS // 2])
    step = between[typical, :, int(np.argmin(square[typical]))]
    shortest = float(step @ step)
    across = np.abs(between[:, 0] * step[1] - between[:, 1] * step[0]) > MIN_ACROSS * np.sqrt(shortest * square)
    across &= square > MIN_LENGTH**2 * shortest
    if not across.any():
        return None
    other, which = np.unravel_index(int(np.argmin(np.where(across, square, np.inf))), square.shape)
    return _averaged(np.stack([step, between[other, :, which]], axis=1), between.transpose(1, 0, 2).reshape(2, -1))


def _averaged(steps: FloatArray, between: FloatArray) -> FloatArray | None:
    """The steps (2, 2) as all vectors (2, K) between neighbours show them: a single one wavers with its two beams."""
    multiple = np.rint(np.linalg.solve(steps, between))
    multiple[:, np.abs(multiple).max(axis=0) > 1.0] = 0.0
    normal = multiple @ multiple.T
    if np.linalg.det(normal) < SINGULAR:
        return None
    return np.asarray(np.linalg.solve(normal, multiple @ between.T).T, dtype=np.float64)


def _adjacent(grid: IntArray) -> Neighbours:
    place = grid - grid.min(axis=0) + 1
    columns = int(place[:, 1].max()) + 2
    flat = place[:, 0] * columns + place[:, 1]
    image = np.full((int(place[:, 0].max()) + 2) * columns, len(grid), dtype=np.int32)
    image[flat] = np.arange(len(grid), dtype=np.int32)
    steps = [i * columns + j for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    around = np.empty((8, len(grid)), dtype=np.int32)
    for row, step in zip(around, steps, strict=True):
        np.take(image, flat + step, out=row)
    return around.T


def _nearest(beams: FloatArray) -> Neighbours:
    from scipy.spatial import cKDTree

    query = cKDTree(beams).query(beams, min(9, len(beams)))
    distance, index = np.asarray(query[0]), np.asarray(query[1], dtype=np.int32)
    reach = MAX_SPACINGS * float(np.median(distance[:, 1]))
    return np.where(distance[:, 1:] <= reach, index[:, 1:], np.int32(len(beams)))
