"""Public names of a package that are imported on first use, so that importing the package stays fast (PEP 562)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module


def lazy_names(
    package: str, homes: Mapping[str, str], *others: str
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Make the ``__getattr__`` and ``__dir__`` of a package.

    Parameters
    ----------
    package : str
        Its full name.
    homes : mapping of str to str
        Each public name, and the module of the package that defines it.
    *others : str
        Public names that the package itself defines, for ``dir``.

    Returns
    -------
    tuple of two functions
        To be assigned to ``__getattr__`` and ``__dir__`` in the package's ``__init__``.
    """

    def getattr_(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    return getattr_, lambda: sorted([*homes, *others])
