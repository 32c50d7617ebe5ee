"""Libraries that only some formats need."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

from picoradar.instrument.files.export.errors import ExportError


def library(name: str, path: Path) -> ModuleType:
    """Import a library that is not part of a plain installation.

    Parameters
    ----------
    name : str
        Name of the module.
    path : Path
        File that needs it, for the message.

    Raises
    ------
    ExportError
        If it is not installed: what to install.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        remedy = "install it with: pip install 'picoradar[formats]'"
        raise ExportError(
            f"{path.name}: {path.suffix} needs the library {name}, which is not installed; {remedy}"
        ) from error
