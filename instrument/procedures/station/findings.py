"""What procedures find when the bench is not as asked for, in words; and the outcome that carries it."""

from __future__ import annotations

from picoradar.instrument.procedures.station.outcome import Outcome, Readings

MIN_SHARE = 0.75  # of the readings that must carry an echo, lest those that are left be a selection


def lost_readings(found: int, asked: int, what: str) -> str:
    """Say that too many readings have no echo; empty when enough have one."""
    if found >= MIN_SHARE * asked:
        return ""
    lost = asked - found
    reason = "the lid is closed, or nothing stands within the range" if found == 0 else "look at beam, target and laser"
    return f"{lost} of {asked} readings of {what} have no range: {reason}."


def refused(name: str, finding: str, remedy: str, readings: dict[str, Readings] | None = None) -> Outcome:
    """Return the outcome of a bench that does not fit: a finding instead of a fit."""
    return Outcome(
        name,
        False,
        [finding],
        remedy,
        ("no figure", "nothing was fitted to these readings"),
        {},
        readings=readings or {},
    )
