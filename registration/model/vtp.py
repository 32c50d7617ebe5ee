"""Reading VTK XML polygonal data (``.vtp``): ASCII, inline base64 and appended data, plain or zlib-compressed.

Source: VTK file formats, section "XML file formats" (PolyData; header type, compressor, appended data).
"""

from __future__ import annotations

import base64
import xml.etree.ElementTree as ElementTree
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from picoradar.registration._types import FloatArray, IntArray
from picoradar.registration.errors import MeshError
from picoradar.registration.model.limits import LARGEST_ARRAY_BYTES

_DTYPES = {
    "Float32": "f4", "Float64": "f8", "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2",
    "Int32": "i4", "UInt32": "u4", "Int64": "i8", "UInt64": "u8",
}  # fmt: skip


class _Decoder:
    """Decodes the data arrays of one file."""

    def __init__(self, root: ElementTree.Element, appended: bytes) -> None:
        self.order = "<" if root.get("byte_order", "LittleEndian") == "LittleEndian" else ">"
        self.header = np.dtype(self.order + _DTYPES[root.get("header_type", "UInt32")])
        self.compressed = "ZLib" in root.get("compressor", "")
        if root.get("compressor") and not self.compressed:
            raise MeshError(f"compressor {root.get('compressor')} is not supported: save with zlib or uncompressed")
        self.appended = appended
        block = root.find("AppendedData")
        self.appended_base64 = block is not None and block.get("encoding") == "base64"

    def array(self, element: ElementTree.Element) -> npt.NDArray[Any]:
        dtype = np.dtype(self.order + _DTYPES[element.get("type", "Float32")])
        form = element.get("format", "ascii")
        if form == "ascii":
            return np.array((element.text or "").split(), dtype=dtype)
        if form == "binary":
            raw = self._from_base64("".join((element.text or "").split()).encode("ascii"))
        elif self.appended_base64:
            raw = self._from_base64(self.appended[int(element.get("offset", "0")) :])
        else:
            raw = self._blocks(self.appended[int(element.get("offset", "0")) :])
        return np.frombuffer(raw, dtype=dtype)

    def _from_base64(self, text: bytes) -> bytes:
        """Header and data are encoded apart, so the header's length says where the data starts."""
        if not self.compressed:
            return self._blocks(_decoded(text, self.header.itemsize + self._first(text)))
        count = self._first(text)
        head = self.header.itemsize * (3 + count)
        head_text = 4 * ((head + 2) // 3)
        head_bytes = _decoded(text, head)
        sizes = np.frombuffer(head_bytes, dtype=self.header)[3:]
        return self._blocks(head_bytes + _decoded(text[head_text:], int(sizes.sum())))

    def _first(self, text: bytes) -> int:
        return int(np.frombuffer(_decoded(text, self.header.itemsize), dtype=self.header)[0])

    def _blocks(self, data: bytes) -> bytes:
        """Strip the header and undo the compression."""
        width = self.header.itemsize
        first = int(np.frombuffer(data[:width], dtype=self.header)[0])
        if not self.compressed:
            return data[width : width + first]
        if first == 0:
            return b""
        if len(data) < (3 + first) * width:
            raise ValueError(f"it is cut off: {first} compressed blocks are stated")
        _, block, last, *sizes = (int(n) for n in np.frombuffer(data[: (3 + first) * width], dtype=self.header))
        if first * block > LARGEST_ARRAY_BYTES + block:
            raise ValueError(f"an array of it has {first * block} bytes; at most {LARGEST_ARRAY_BYTES} are read")
        at, parts = (3 + first) * width, []
        for number, size in enumerate(sizes, start=1):
            stated = last if number == first and last else block
            parts.append(_unpacked(data[at : at + size], stated))
            at += size
        return b"".join(parts)


def _unpacked(data: bytes, stated: int) -> bytes:
    """Decompress a block; never more than it states."""
    unpacker = zlib.decompressobj()
    plain = unpacker.decompress(data, stated + 1)
    if len(plain) != stated:
        raise ValueError(f"a compressed block of it has not the {stated} bytes that it states")
    return plain


def _decoded(text: bytes, count: int) -> bytes:
    return base64.b64decode(text[: 4 * ((count + 2) // 3)])[:count]


def read_vtp(content: bytes) -> tuple[FloatArray, IntArray]:
    """Read vertices (V, 3) and triangles (F, 3) of all pieces; polygons are fanned into triangles.

    Vertices, lines and triangle strips of a piece take no part.

    Raises
    ------
    Exception
        Any of `picoradar.registration.errors.DECODER_ERRORS`, if it is damaged or is no polygonal data.
    """
    xml, appended = _split_appended(content)
    if b"<!DOCTYPE" in xml or b"<!ENTITY" in xml:  # a few lines of entities can expand to gigabytes
        raise ValueError("it defines entities, which no VTK file does")
    root = ElementTree.fromstring(xml)
    decoder = _Decoder(root, appended)
    pieces = [_piece(decoder, element) for element in root.findall("PolyData/Piece") if _has_surface(element)]
    if not pieces:
        raise ValueError("it holds no PolyData piece with Points and Polys")
    first = np.cumsum([0, *(len(vertices) for vertices, _ in pieces[:-1])])
    faces = [triangles + before for (_, triangles), before in zip(pieces, first, strict=True)]
    return np.concatenate([vertices for vertices, _ in pieces]), np.concatenate(faces)


def _has_surface(piece: ElementTree.Element) -> bool:
    return piece.find("Points/DataArray") is not None and piece.find("Polys/DataArray") is not None


def _piece(decoder: _Decoder, piece: ElementTree.Element) -> tuple[FloatArray, IntArray]:
    """Vertices (V, 3) of one piece, and triangles (F, 3) that count them from 0."""
    arrays = {element.get("Name"): decoder.array(element) for element in piece.findall("Polys/DataArray")}
    vertices = decoder.array(piece.findall("Points/DataArray")[0]).astype(np.float64).reshape(-1, 3)
    faces = _triangles(arrays["connectivity"].astype(np.int64), arrays["offsets"].astype(np.int64))
    if len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise IndexError(f"a polygon names vertex {faces.max()}, the piece has {len(vertices)}")
    return vertices, faces


def _split_appended(content: bytes) -> tuple[bytes, bytes]:
    """Part the XML from the raw appended data, which is no valid XML."""
    start = content.find(b"<AppendedData")
    if start < 0:
        return content, b""
    underscore = content.index(b"_", content.index(b">", start))
    end = content.rfind(b"</AppendedData>")
    return content[: content.index(b">", start) + 1] + content[end:], content[underscore + 1 : end]


def _triangles(connectivity: IntArray, offsets: IntArray) -> IntArray:
    """Fan polygons into triangles (F, 3): the first ones of all polygons, then the second ones, and so on."""
    starts = np.concatenate([[0], offsets[:-1]])
    counts = offsets - starts
    if len(offsets) and (counts.min() < 0 or offsets[-1] > len(connectivity)):
        raise IndexError("the polygons do not end one after the other")
    fans = np.maximum(counts - 2, 0)
    step = np.arange(fans.sum()) - np.repeat(np.cumsum(fans) - fans, fans) + 1
    order = np.argsort(step, kind="stable")
    first, step = np.repeat(starts, fans)[order], step[order]
    return np.stack([connectivity[first], connectivity[first + step], connectivity[first + step + 1]], axis=1)
