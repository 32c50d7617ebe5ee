"""The numeric fields of nested settings, by path, and settings with one of them moved by a factor."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any

NEAR_ONE = (0.5, 1.5)
"""Numbers between these, but for lengths, are moved in their distance from one: twice 0.75 would be no share."""


def numeric_fields(settings: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Paths and values of the numbers, and tuples of numbers, in nested dataclasses.

    A tuple of dataclasses (stages) counts as one of them: its fields are moved in all of them at once.
    """
    for entry in fields(settings):
        value, here = getattr(settings, entry.name), (*path, entry.name)
        if is_dataclass(value):
            yield from numeric_fields(value, here)
        elif isinstance(value, tuple) and is_dataclass(value[0]):
            yield from (
                (deep, tuple(_at(one, deep[len(here) :]) for one in value))
                for deep, _ in numeric_fields(value[0], here)
            )
        elif not isinstance(value, bool):
            yield here, value


def with_moved(settings: Any, path: tuple[str, ...], factor: float) -> Any:
    """The settings with the field at a path moved by a factor; counts are rounded, and stay at least 1."""
    name, *rest = path
    value = getattr(settings, name)
    if rest and isinstance(value, tuple):
        return replace(settings, **{name: tuple(with_moved(one, tuple(rest), factor) for one in value)})
    if rest:
        return replace(settings, **{name: with_moved(value, tuple(rest), factor)})
    return replace(settings, **{name: moved(value, factor, is_length=name.endswith("_mm"))})


def moved(value: Any, factor: float, *, is_length: bool) -> Any:
    """A number, or all of a tuple of numbers, moved by a factor."""
    if isinstance(value, tuple):
        if not is_length and all(NEAR_ONE[0] < one < NEAR_ONE[1] for one in value):
            return tuple(1.0 + (one - 1.0) * factor for one in value)
        return tuple(one * factor for one in value)
    if isinstance(value, int):
        return max(1, math.floor(value * factor + 0.5))
    if not is_length and NEAR_ONE[0] < value < 1.0:
        return 1.0 - (1.0 - value) * factor
    return value * factor


def shown(value: Any) -> str:
    """A value for a table; of several stages each once."""
    if isinstance(value, tuple):
        return ", ".join(dict.fromkeys(shown(one) for one in value))
    return f"{value:g}"


def _at(settings: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        settings = getattr(settings, name)
    return settings
