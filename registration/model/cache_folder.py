"""The folder of the cache: where it is, what is in it, and that it does not grow without end."""

from __future__ import annotations

import contextlib
import os
import re
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

VERSION = 10
"""Raised whenever the reading of mesh files, their preparation or the layout of the files here changes."""

DEFAULT_LIMIT_MIB = 1024.0
"""Size that the cache is kept below, MiB: about a hundred models of 9 MiB; ``PICORADAR_CACHE_MIB`` sets another."""

ABANDONED_S = 3600.0
"""Age after which a half-written file is one of a program that died, s; writing takes less than a second."""

_NAME = re.compile(r"registration-v(?P<version>[0-9]+)-(?P<mesh>file-)?(?P<digest>[0-9a-f]{64})?.*\.npz")


@dataclass(frozen=True)
class CacheContents:
    """What the cache holds.

    Attributes
    ----------
    folder : Path
        It need not exist.
    models : int
        Meshes that are prepared.
    files, size_bytes : int
        All files of the cache, and their size.
    limit_bytes : int
        Size that it is kept below.
    """

    folder: Path
    models: int
    files: int
    size_bytes: int
    limit_bytes: int


def folder() -> Path:
    """The cache folder; it need not exist."""
    named = os.environ.get("PICORADAR_CACHE")
    if named:
        return Path(named)
    try:
        return _base() / "picoradar"
    except RuntimeError:  # a service or a container whose user has no home: no folder can be made, nothing is kept
        return Path(os.devnull) / "picoradar"


def _base() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def path_of(key: str) -> Path:
    """The file of a key."""
    return folder() / f"registration-v{VERSION}-{key}.npz"


def limit_bytes() -> int:
    """Size that the cache is kept below, bytes."""
    try:
        wanted = float(os.environ.get("PICORADAR_CACHE_MIB", DEFAULT_LIMIT_MIB))
    except ValueError:
        wanted = DEFAULT_LIMIT_MIB
    return int(max(0.0, min(wanted, 1e9)) * 2**20)


def opened_own(path: Path) -> IO[bytes]:
    """Open a file of the cache for reading, and note that it was used.

    Raises
    ------
    OSError
        If it is not there, or somebody else could have written it: whoever can, could move the bone.
    """
    file = path.open("rb")
    status = os.fstat(file.fileno())
    if os.name == "posix" and (status.st_uid != os.geteuid() or status.st_mode & 0o022):
        file.close()
        raise PermissionError(f"{path} could have been written by somebody else")
    with contextlib.suppress(OSError):  # a folder that cannot be written to can still be read
        os.utime(path, ns=(time.time_ns(), status.st_mtime_ns))
    return file


def evict(kept: Path) -> None:
    """Remove files of earlier versions, then those not used for longest, until the cache is below its limit.

    Parameters
    ----------
    kept : Path
        The file that was just written; it stays.
    """
    found = sorted((status.st_atime_ns, status.st_size, path) for path, status in _files())
    total = sum(size for _, size, _ in found)
    total -= sum(size for _, size, path in found if _is_outdated(path))
    for _, size, path in found:
        if _is_outdated(path):
            with contextlib.suppress(OSError):
                path.unlink()
        elif path != kept and total > limit_bytes():
            with contextlib.suppress(OSError):  # another program has removed it, or reads it (Windows)
                path.unlink()
                total -= size


def contents_of_cache() -> CacheContents:
    """Say what the cache holds."""
    found = [(path, status.st_size) for path, status in _files()]
    names = [_NAME.fullmatch(path.name) for path, _ in found]
    models = {name["digest"] for name in names if name and name["digest"] and not name["mesh"]}
    return CacheContents(folder(), len(models), len(found), sum(size for _, size in found), limit_bytes())


def clear_cache() -> CacheContents:
    """Remove all files of the cache, and say what was there. Models are prepared anew when they are next needed."""
    before = contents_of_cache()
    for path, _ in _files():
        path.unlink(missing_ok=True)
    return before


def _files() -> Iterator[tuple[Path, os.stat_result]]:
    """Files of the cache, also half-written ones that were abandoned; nothing else that lies in the folder."""
    for path in [*folder().glob("registration-v*.npz"), *folder().glob("registration-*.part")]:
        with contextlib.suppress(OSError):
            status = path.lstat()
            if path.suffix != ".part" or time.time() - status.st_mtime > ABANDONED_S:
                yield path, status


def _is_outdated(path: Path) -> bool:
    name = _NAME.fullmatch(path.name)
    return path.suffix == ".part" or (name is not None and int(name["version"]) < VERSION)
