"""Stages for the bench procedures: the simulator's, and a person who is asked."""

from __future__ import annotations

import sys

import numpy as np

from instrument.cli.simulated import Simulated
from instrument.errors import BadInput
from instrument.procedures.stage import Placing
from instrument.settings import Settings, override

_BODIES = {"card": "plate", "scale": "plate", "plate": "plate", "prism": "prism", "step": "step"}


HIDDEN = {
    "mirror_separation_mm": (27.0, 33.0),
    "x_scale_error": (-0.01, 0.01),
    "y_scale_error": (-0.01, 0.01),
    "x_offset_deg": (-0.5, 0.5),
    "y_offset_deg": (-0.5, 0.5),
    "non_orthogonality_deg": (-0.3, 0.3),
}
"""Errors of a simulated scanner that a procedure must find, each drawn between two bounds."""


def with_hidden_errors(settings: Settings) -> Settings:
    """Return the settings of a simulated bench with errors of the scanner that are drawn from its seed.

    Raises
    ------
    BadInput
        When the settings have real devices.
    """
    if settings.bench != "simulated":
        raise BadInput("--hidden-errors is for the simulated bench; this settings file has real devices")
    rng = np.random.default_rng([settings.seed, len(HIDDEN)])
    return override(settings, {"simulation": {name: float(rng.uniform(*bounds)) for name, bounds in HIDDEN.items()}})


class SimulatedStage:
    """Moves the targets of the simulated bench."""

    def __init__(self, simulated: Simulated) -> None:
        self._bench = simulated.bench

    def __str__(self) -> str:
        return "simulated stage"

    def place(self, wanted: Placing) -> float:
        """Put a target up; its scale is exact."""
        tilt_x, tilt_y = wanted.tilt_deg
        pose = (0.0, 0.0, wanted.distance_mm, tilt_x, tilt_y, 0.0)
        try:
            self._bench.place(_BODIES[wanted.body], pose, reflectance=wanted.gray)
        except (KeyError, ValueError) as error:
            raise BadInput(f"simulated stage: cannot put up {wanted}: {error}") from error
        return wanted.distance_mm

    def read_scale(self) -> tuple[float, float]:
        """Read the spot on the scale."""
        return self._bench.read_scale()


class PersonStage:
    """Asks the person at the bench to put targets up and to read the scale; the laser is off meanwhile."""

    def __str__(self) -> str:
        return "targets placed by hand"

    def place(self, wanted: Placing) -> float:
        """Ask for a target, and for its distance as the rail's scale shows it."""
        given = _ask(f"Put up: {wanted}. Its distance as read, in mm (Enter: {wanted.distance_mm:g}): ")
        return wanted.distance_mm if not given else _number(given)

    def read_scale(self) -> tuple[float, float]:
        """Ask where the spot stands."""
        given = _ask("Where does the spot stand on the scale? x,y in mm: ").split(",")
        if len(given) != 2:
            raise BadInput("two numbers with a comma between are needed; run the procedure again")
        return _number(given[0]), _number(given[1])


def _ask(question: str) -> str:
    if not sys.stdin.isatty():
        raise BadInput("this procedure needs a person at the terminal to move the target; run it in a terminal")
    sys.stderr.write(question)
    sys.stderr.flush()
    return sys.stdin.readline().strip()


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise BadInput(f"{text!r} is no number; run the procedure again") from error
