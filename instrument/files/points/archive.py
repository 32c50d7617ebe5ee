"""Arrays out of a NumPy archive (``.npz``): sizes are checked by the directory and the headers before unpacking."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.errors import DECODER_ERRORS, decoder_words
from picoradar.instrument.files.points.errors import PointFileError
from picoradar.instrument.files.points.limits import LARGEST_ARRAY_BYTES

_READ_HEADER = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def read_arrays(path: Path, names: tuple[str, ...]) -> Mapping[str, NDArray[np.generic]]:
    """Read those of the arrays that are there; the others of the archive are not touched.

    Raises
    ------
    PointFileError
        If it is no archive of plain arrays, or an array that is asked for is too large.
    OSError
        If it cannot be read.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            found = {name: _array(archive, members[name]) for name in names if name in members}
    except DECODER_ERRORS as error:
        what = f"is no archive of plain arrays ({decoder_words(error)})"
        raise PointFileError(path, what, "write it with numpy.savez") from error
    if not found:
        what = f"has the arrays {', '.join(members)[:200] or 'none'}"
        raise PointFileError(path, what, "put the points into an array points_mm of (N, 3)")
    return found


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[np.generic]:
    if info.file_size > LARGEST_ARRAY_BYTES:
        raise ValueError(f"{info.filename} has {info.file_size} bytes; at most {LARGEST_ARRAY_BYTES} are read")
    with archive.open(info) as member:
        shape, fortran_order, dtype = _header(member)
        if dtype.hasobject:
            raise ValueError(f"{info.filename} holds Python objects, not numbers")
        size = math.prod(shape) * dtype.itemsize
        content = member.read(size + 1) if size <= LARGEST_ARRAY_BYTES else b""  # read to the end, check sum included
    if len(content) != size:
        raise ValueError(f"{info.filename} has not the {size} bytes that {shape} numbers take")
    values = np.frombuffer(content, dtype)
    return values.reshape(shape, order="F" if fortran_order else "C")


def _header(member: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[np.generic]]:
    read = _READ_HEADER.get(np.lib.format.read_magic(member))
    if read is None:
        raise ValueError("an array is of a later version of NumPy's format")
    shape, fortran_order, dtype = read(member)
    return shape, fortran_order, dtype
