"""stdout and stderr that never raise: a closed pipe or a full disk must change neither a scan nor its exit status."""

from __future__ import annotations

import os
import sys
from typing import IO, TextIO, cast


class TolerantStream:
    """A text stream whose writes may fail without a word; the first failure is kept.

    Parameters
    ----------
    stream : text stream or None
        None is what Python makes of a stream that was closed before the program began.

    Attributes
    ----------
    failure : str
        Why what was written did not arrive; empty when it did. A reader that has left (``| head``) is no failure.
    """

    def __init__(self, stream: IO[str] | None) -> None:
        self.failure = "" if stream is not None else "it is closed"
        self._stream = stream if stream is not None else open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115

    def write(self, text: str) -> int:
        """Write text; returns its length, whatever came of it."""
        try:
            self._stream.write(text)
        except (OSError, ValueError) as error:  # ValueError: closed in the meantime
            self._failed(error)
        return len(text)

    def flush(self) -> None:
        """Flush as far as it goes."""
        try:
            self._stream.flush()
        except (OSError, ValueError) as error:
            self._failed(error)

    def _failed(self, error: Exception) -> None:
        if not isinstance(error, BrokenPipeError):
            self.failure = self.failure or str(error)
        # What is left in the buffer would fail again when the interpreter ends, and change the exit status.
        self._stream = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
        if (descriptor := _descriptor_of(self)) is not None:
            os.dup2(self._stream.fileno(), descriptor)

    def __getattr__(self, name: str) -> object:
        """Take everything else (``encoding``, ``isatty``, ``fileno``) from the stream."""
        return getattr(self._stream, name)


def make_tolerant() -> None:
    """Replace ``sys.stdout`` and ``sys.stderr``."""
    sys.stdout, sys.stderr = (cast("TextIO", TolerantStream(stream)) for stream in (sys.stdout, sys.stderr))


def tell_of_failures() -> None:
    """Flush both, and say on stderr when what was written to stdout did not arrive."""
    sys.stdout.flush()
    failure = getattr(sys.stdout, "failure", "")
    if failure:
        sys.stderr.write(
            f"picoradar: stdout could not be written: {failure}; what was printed is lost, the work is not\n"
        )
    sys.stderr.flush()


def _descriptor_of(stream: TolerantStream) -> int | None:
    """Get 1 or 2 for the program's own streams."""
    return 1 if stream is sys.stdout else 2 if stream is sys.stderr else None
