"""What a GLB file states of its size, before trimesh makes it: arrays without data, and one mesh in many places.

Source: glTF 2.0 specification, sections 3.6 (accessors: without a buffer view they are zeros) and 4.4 (GLB container).
"""

from __future__ import annotations

import json
from typing import Any

from picoradar.registration.model.limits import LARGEST_ARRAY_BYTES, MOST_FACES, MOST_NODES

_HEAD = 20  # magic, version, length; length and type of the first chunk
_JSON = b"JSON"
_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


def check_glb(content: bytes) -> None:
    """Refuse a file that would become larger than it may.

    Raises
    ------
    Exception
        Any of `picoradar.registration.errors.DECODER_ERRORS`, in words where a size is exceeded.
    """
    if content[:4] != b"glTF" or content[16:20] != _JSON:
        raise ValueError("it does not begin as a GLB file does")
    table = json.loads(content[_HEAD : _HEAD + int.from_bytes(content[12:16], "little")])
    nodes, meshes, accessors = (table.get(name, []) for name in ("nodes", "meshes", "accessors"))
    if len(nodes) > MOST_NODES:
        raise ValueError(f"its scene has {len(nodes)} nodes; at most {MOST_NODES} are read")
    counts = [_count(accessor) for accessor in accessors]
    for accessor, count in zip(accessors, counts, strict=True):
        if count * _BYTES[accessor["componentType"]] * _NUMBERS[accessor["type"]] > LARGEST_ARRAY_BYTES:
            raise ValueError(f"an array of it has {count} entries; at most {LARGEST_ARRAY_BYTES} bytes are read")
    corners = [sum(counts[_corners(primitive)] for primitive in mesh["primitives"]) for mesh in meshes]
    placed = sum(corners[node["mesh"]] for node in nodes if "mesh" in node)
    if placed + sum(corners) > 2 * 3 * MOST_FACES:
        raise ValueError(f"its scene has {placed // 3} triangles; at most {MOST_FACES} are read")


def _count(accessor: dict[str, Any]) -> int:
    count = accessor["count"]
    if not isinstance(count, int) or count < 0:
        raise ValueError(f"an array of it has {count!r} entries")
    return count


def _corners(primitive: dict[str, Any]) -> int:
    """Index of the accessor that says how many corners a primitive has."""
    indices = primitive.get("indices")
    corners = primitive["attributes"]["POSITION"] if indices is None else indices
    if not isinstance(corners, int) or corners < 0:
        raise ValueError(f"a mesh of it names the array {corners!r}")
    return corners
