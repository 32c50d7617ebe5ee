"""VTP files for the fuzzer: plain, compressed and appended ones, and mutations inside their compressed blocks."""

from __future__ import annotations

import base64
import random
import re
import struct
import zlib

import numpy as np
import trimesh

from benchmarks.fuzz import mutate


def sound_vtp() -> list[bytes]:
    """The same body in text, in base64, compressed, and with appended data."""
    body = trimesh.creation.icosphere(subdivisions=1, radius=30.0)
    points, faces = body.vertices.astype("<f8"), body.faces.astype("<i8")
    offsets = 3 * np.arange(1, len(faces) + 1, dtype="<i8")
    arrays = (("Float64", "Points", points), ("Int64", "connectivity", faces), ("Int64", "offsets", offsets))

    def text(array: np.ndarray) -> str:
        return " ".join(map(repr, array.ravel().tolist()))

    def plain(array: np.ndarray) -> str:
        return base64.b64encode(struct.pack("<I", array.nbytes) + array.tobytes()).decode()

    def made(form: str, encode: object, compressor: str = "", appended: str = "") -> bytes:
        data = [
            f'<DataArray type="{kind}" Name="{name}" format="{form}"{encode(a)}</DataArray>' for kind, name, a in arrays
        ]  # type: ignore[operator]
        return (
            f'<?xml version="1.0"?><VTKFile type="PolyData" byte_order="LittleEndian"{compressor}><PolyData><Piece>'
            f"<Points>{data[0]}</Points><Polys>{data[1]}{data[2]}</Polys></Piece></PolyData>{appended}</VTKFile>"
        ).encode()

    zlib_name = ' compressor="vtkZLibDataCompressor"'
    at, parts = [0], []
    for _, _, array in arrays:
        parts.append(struct.pack("<I", array.nbytes) + array.tobytes())
        at.append(at[-1] + len(parts[-1]))
    offset = iter(at)
    raw = made(
        "appended", lambda _: f' offset="{next(offset)}">', appended="<AppendedData encoding='raw'>_DATA</AppendedData>"
    )
    return [
        made("ascii", lambda array: f">{text(array)}"),
        made("binary", lambda array: f">{plain(array)}"),
        made("binary", lambda array: f">{packed(array.tobytes())}", zlib_name),
        raw.replace(b"DATA", b"".join(parts)),
    ]


def packed(content: bytes, block: int = 1000, stated: int | None = None) -> str:
    """Compress in blocks, as VTK does, and encode; ``stated`` is the size of a block that is told."""
    pieces = [content[k : k + block] for k in range(0, len(content), block)] or [b""]
    blocks = [zlib.compress(piece) for piece in pieces]
    last = len(pieces[-1]) % block
    size = block if stated is None else stated
    head = struct.pack(f"<{3 + len(blocks)}I", len(blocks), size % 2**32, last, *map(len, blocks))
    return base64.b64encode(head).decode() + base64.b64encode(b"".join(blocks)).decode()


def packed_block(rng: random.Random, content: bytes) -> bytes:
    """Put another compressed array in place of one: mutated, of another size than stated, or a bomb."""
    found = list(re.finditer(rb">[A-Za-z0-9+/=]{40,}<", content))
    if not found:
        return mutate.text_number(rng, content)
    chosen = rng.choice(found)
    plain = rng.choice((b"", bytes(24), rng.randbytes(72), np.arange(60, dtype="<f8").tobytes(), bytes(5_000_000)))
    stated = rng.choice((None, None, 0, 1, 2**32 - 1, len(plain), 10 * len(plain) + 1))
    new = (
        packed(plain, block=rng.choice((24, 1000, 10_000_000)), stated=stated)
        if len(plain) < 1000
        else packed(plain, block=10_000_000, stated=stated)
    )
    return content[: chosen.start() + 1] + new.encode() + content[chosen.end() - 1 :]
