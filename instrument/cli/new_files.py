"""Where a command will write, made sure of before anything is switched: a refusal costs no warm-up."""

from __future__ import annotations

from pathlib import Path

from picoradar.instrument.errors import BadInput


def make_folder(folder: Path, advice: str, *, exist_ok: bool = True) -> None:
    """Make a folder for what may be a patient's (mode 0700), and make sure that a recording can be made in it.

    Parameters
    ----------
    folder : Path
    advice : str
        What to do instead, for the message.
    exist_ok : bool
        Whether it may be there already.

    Raises
    ------
    BadInput
        When it cannot be made.
    RecordingError
        When no recording can be made in it.
    """
    from picoradar.instrument.recording import refuse_unwritable

    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=exist_ok)
    except FileExistsError as error:
        raise BadInput(f"{folder} exists already; {advice}") from error
    except OSError as error:
        raise BadInput(f"{folder}: the folder cannot be made: {error}; {advice}") from error
    refuse_unwritable(folder)


def refuse_taken(path: Path, advice: str) -> None:
    """Refuse the name of a file that is there, unless it is a recording that was never born.

    Raises
    ------
    BadInput
    """
    from picoradar.instrument.recording import free_stillborn

    try:
        there = path.exists()
    except OSError as error:  # a name that is too long, a folder that may not be looked into
        raise BadInput(f"{path}: cannot be made: {error.strerror}; {advice}") from error
    if there and not free_stillborn(path):
        raise BadInput(f"{path} exists already and will not be written over; {advice}")
