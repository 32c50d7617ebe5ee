"""Stages for the bench procedures: the simulator's, and a person who is asked."""

from __future__ import annotations

import numpy as np

from picoradar.instrument.cli.person import Person
from picoradar.instrument.cli.simulated import Simulated
from picoradar.instrument.errors import BadInput
from picoradar.instrument.procedures.station import Placing
from picoradar.instrument.settings import Settings, override

READING_ROOM_MM = 100.0  # between the distance asked for and the one read; more is taken for a typing error
SCALE_HALF_MM = 500.0
_BODIES = {"card": "plate", "scale": "plate", "plate": "plate", "prism": "prism", "step": "step", "coated": "coated"}


HIDDEN = {
    "mirror_separation_mm": (27.0, 33.0),
    "x_scale_error": (-0.01, 0.01),
    "y_scale_error": (-0.01, 0.01),
    "x_offset_deg": (-0.5, 0.5),
    "y_offset_deg": (-0.5, 0.5),
    "non_orthogonality_deg": (-0.3, 0.3),
}
"""Errors of a simulated scanner that a procedure must find, each uniform between two bounds."""


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
    """Places the targets of the simulated bench."""

    reads_at_once = True

    def __init__(self, simulated: Simulated) -> None:
        self._bench = simulated.bench

    def __str__(self) -> str:
        return "simulated stage"

    def place(self, wanted: Placing) -> float:
        """Place a target; its distance is exact."""
        tilt_x, tilt_y = wanted.tilt_deg
        pose = (0.0, 0.0, wanted.distance_mm, tilt_x, tilt_y, 0.0)
        try:
            self._bench.place(_BODIES[wanted.body], pose, reflectance=wanted.gray)
        except (KeyError, ValueError) as error:
            raise BadInput(f"simulated stage: cannot place {wanted}: {error}") from error
        return wanted.distance_mm

    def read_scale(self) -> tuple[float, float]:
        """Read the position of the spot on the scale."""
        return self._bench.read_scale()


class PersonStage:
    """Asks the person at the bench to place targets and to read the scale; the laser is off meanwhile."""

    reads_at_once = False

    def __init__(self, person: Person) -> None:
        self._person = person

    def __str__(self) -> str:
        return "targets placed by hand"

    def place(self, wanted: Placing) -> float:
        """Ask for a target, and for its distance as the rail's scale shows it."""
        question = f"Place: {wanted}. Its distance as read, in mm (Enter: {wanted.distance_mm:g}; q: stop):"
        near = (wanted.distance_mm - READING_ROOM_MM, wanted.distance_mm + READING_ROOM_MM)
        return self._person.numbers(question, (near,), (wanted.distance_mm,))[0]

    def read_scale(self) -> tuple[float, float]:
        """Ask for the position of the spot."""
        allowed = ((-SCALE_HALF_MM, SCALE_HALF_MM), (-SCALE_HALF_MM, SCALE_HALF_MM))
        x_mm, y_mm = self._person.numbers("Position of the spot on the scale? x,y in mm:", allowed)
        return x_mm, y_mm
