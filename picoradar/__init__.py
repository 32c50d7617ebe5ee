"""A picosecond pulsed laser radar, and the pose of a bone in a preoperative model.

Four packages, each usable alone: `drivers`, `registration`, `sim` and `instrument`.
The names below are what a notebook needs; each is imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from picoradar._lazy import lazy_names

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

__getattr__, __dir__ = lazy_names(__name__, _HOMES, "__version__")
