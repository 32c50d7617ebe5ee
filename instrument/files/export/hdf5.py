"""HDF5 by h5py: the tree of `picoradar.instrument.files.export.tree`, opened by MATLAB, xarray and many more."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from picoradar.instrument.files.export.optional import library
from picoradar.instrument.files.export.tree import Node, Tree


def write_h5(path: Path, tree: Tree) -> None:
    """Write the tree; without time stamps, so that the same tree gives the same bytes."""
    with library("h5py", path).File(path, "w") as root:
        tree.write(root, _make)


def holds_h5(path: Path, tree: Tree) -> bool:
    """Return whether a file reads back as the tree."""
    with library("h5py", path).File(path, "r") as root:
        return tree.held_by(root)


class Hdf5Group(Node, Protocol):
    """A group that makes arrays."""

    def create_dataset(self, name: str, **options: object) -> Node: ...


def _make(group: Hdf5Group, name: str, shape: tuple[int, ...], dtype: np.dtype[np.generic]) -> Node:
    large = int(np.prod(shape)) > 0 and name == "sums"
    packed: dict[str, object] = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if large else {}
    return group.create_dataset(name, shape=shape, dtype=dtype, track_times=False, **packed)
