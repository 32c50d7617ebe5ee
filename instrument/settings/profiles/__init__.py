"""Settings profiles: commented TOML files to start from, one a purpose."""

from __future__ import annotations

from importlib import resources

from picoradar.instrument.errors import BadInput

PROFILES = ("bench", "gray-target", "operating-room")


def profile_text(name: str) -> str:
    """Get the TOML text of a profile.

    Raises
    ------
    BadInput
        When there is no such profile.
    """
    if name not in PROFILES:
        raise BadInput(f"{name!r} is no settings profile; there are {', '.join(PROFILES)}")
    return (resources.files("picoradar.instrument.settings.profiles") / f"{name}.toml").read_text(encoding="utf-8")
