"""How much memory a piece of work takes at its peak."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable


def peak_bytes(use: Callable[[], object]) -> int:
    """Run a piece of work; returns the most that Python had allocated for it, bytes."""
    tracemalloc.start()
    try:
        use()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
