"""Events of a run as structured log lines, with run id and state in each."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from typing import Any, Protocol, TextIO

JsonObject = dict[str, Any]
"""What JSON calls an object: plain data by name."""


class Log(Protocol):
    """A logger of events with fields."""

    def bind(self, **context: object) -> Log:
        """Return a logger that carries more context."""

    def info(self, event: str, **fields: object) -> None:
        """Write an event of the ordinary course."""

    def warning(self, event: str, **fields: object) -> None:
        """Write an event that a person should know of."""

    def error(self, event: str, **fields: object) -> None:
        """Write a failure that the run survives."""

    def critical(self, event: str, **fields: object) -> None:
        """Write a failure that a person must act on."""


def configure(
    level: int = logging.WARNING, stream: TextIO | None = None, keep: Callable[..., Any] | None = None
) -> None:
    """Send events of at least ``level`` to ``stream`` (default: stderr), one line each.

    A terminal gets aligned text, anything else JSON. Without this call structlog's defaults hold. ``keep`` is a
    processor of structlog that gets each event before it is written (`IncidentLog`).
    """
    import structlog  # here and below, because it makes --help slow

    out = sys.stderr if stream is None else stream
    renderer: Any = structlog.dev.ConsoleRenderer() if out.isatty() else structlog.processors.JSONRenderer()
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            structlog.processors.add_log_level,
            *([keep] if keep is not None else []),
            renderer,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=structlog.WriteLoggerFactory(file=out),
        cache_logger_on_first_use=False,
    )


def logger(**context: object) -> Log:
    """Get a logger that carries ``context`` in every event."""
    import structlog

    log: Log = structlog.get_logger().bind(**context)
    return log
