"""`beside_landmarks`: a registration that began at landmarks, and what they say of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from picoradar.registration.errors import RegistrationError
from picoradar.registration.search import Landmarks
from picoradar.registration.trust import Registration

FOUND_ANYWHERE = (
    "From the landmarks no pose explains the points; this one was found without them, from anywhere. Click them again."
)


def beside_landmarks(
    found: Registration | RegistrationError, marks: Landmarks, from_anywhere: Callable[[], Registration]
) -> Registration:
    """Return the registration with what the landmarks say of it, searched from anywhere where they led to none.

    A pair that is off is named, and two that were exchanged. A pose that most landmarks contradict is a caution at
    best: it may be the other side, or the list of another patient.

    Parameters
    ----------
    found : Registration or RegistrationError
        What the start by landmarks led to.
    marks : Landmarks
    from_anywhere : callable
        Registers without them.

    Raises
    ------
    RegistrationError
        As given, where the second try leads to nothing either.
    """
    reasons: list[str] = []
    if isinstance(found, RegistrationError) or found.verdict == "fail":
        try:
            other = from_anywhere()
        except RegistrationError:
            other = None
        if other is not None and other.verdict != "fail":
            found, reasons = other, [FOUND_ANYWHERE]
    if isinstance(found, RegistrationError):
        raise found
    pose = found.model_from_scanner
    of_pairs = marks.sentences()
    off = () if found.verdict == "fail" else marks.far_off(pose)
    reasons += of_pairs or (marks.beside(pose) if off else ())
    if not reasons:
        return found
    contradicted = reasons[0] == FOUND_ANYWHERE or 2 * len(off) > len(marks.model)
    if contradicted and found.verdict == "pass":
        return replace(found, verdict="caution", reasons=reasons)
    return replace(found, reasons=[*found.reasons, *reasons])
