"""A picosecond pulsed laser radar, and the pose of a bone in a preoperative model.

Four packages, each usable alone: `drivers`, `registration`, `sim` and `instrument`.
The names below are what a notebook needs; each is imported when it is asked for.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from picoradar.instrument.ranging import estimate
    from picoradar.instrument.recording import open_recording
    from picoradar.registration import load_model, prepare_model, register
    from picoradar.sim import SimulatedBench

__version__ = "0.2.0.dev0"

__all__ = ["SimulatedBench", "__version__", "estimate", "load_model", "open_recording", "prepare_model", "register"]

_HOMES = {
    "SimulatedBench": "sim",
    "estimate": "instrument.ranging",
    "load_model": "registration",
    "open_recording": "instrument.recording",
    "prepare_model": "registration",
    "register": "registration",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'picoradar' has no attribute {name!r}")
    return getattr(import_module(f"picoradar.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
