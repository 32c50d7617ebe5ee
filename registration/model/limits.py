"""Sizes that a model file may have; checked by what it states, before anything of it is unpacked or made."""

from __future__ import annotations

LARGEST_FILE_BYTES = 1_000_000_000
"""A mesh file, bytes: `MOST_FACES` as a text STL, which takes about 250 a triangle."""

MOST_FACES = 4_000_000
"""Triangles of a model; a hip bone from CT has 0.1 to 1 million."""

LARGEST_ARRAY_BYTES = 8 * 3 * 3 * MOST_FACES
"""One array of a file, unpacked, bytes: three corners of three float64 for each of `MOST_FACES`."""

MOST_NODES = 10_000
"""Nodes of the scene of a GLB file; a model has a few."""
