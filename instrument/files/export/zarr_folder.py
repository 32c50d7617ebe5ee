"""Zarr version 3, a folder: the tree of `picoradar.instrument.files.export.tree`, read in parts by dask and xarray."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from picoradar.instrument.files.export.optional import library
from picoradar.instrument.files.export.tree import Node, Tree

_CHUNK_ROWS = 4096


def write_zarr(path: Path, tree: Tree) -> None:
    """Write the tree into a new folder."""
    tree.write(library("zarr", path).open_group(str(path), mode="w", zarr_format=3), _make)


def holds_zarr(path: Path, tree: Tree) -> bool:
    """Return whether a folder reads back as the tree."""
    return tree.held_by(library("zarr", path).open_group(str(path), mode="r"))


class ZarrGroup(Node, Protocol):
    """A group that makes arrays."""

    def create_array(self, name: str, **options: object) -> Node: ...


def _make(group: ZarrGroup, name: str, shape: tuple[int, ...], dtype: np.dtype[np.generic]) -> Node:
    chunks = (max(1, min(shape[0], _CHUNK_ROWS)), *(max(1, length) for length in shape[1:]))
    return group.create_array(name, shape=shape, dtype=dtype, chunks=chunks)
