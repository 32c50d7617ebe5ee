"""What puts targets in front of the scanner: a rail, a person, or the simulator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class Placing:
    """Where a target is asked to stand.

    Attributes
    ----------
    body : str
        ``plate`` (flat, diffuse), ``card`` (gray card on the plate), ``prism``, ``step``, ``scale`` (plate with a
        millimetre scale) or ``coated`` (flat piece of bone or tissue, half of it painted).
    distance_mm : float
        From the scanner's front reference (mirror 1's axis less the mirror separation) along the beam at rest.
    tilt_deg : (float, float)
        Turns of the target about x and y.
    gray : float or None
        Reflectance of the card, 0 to 1; None leaves the body's own.
    """

    body: str
    distance_mm: float
    tilt_deg: tuple[float, float] = (0.0, 0.0)
    gray: float | None = None

    def __str__(self) -> str:
        gray = "" if self.gray is None else f" of reflectance {self.gray:.2f}"
        tilt = "" if self.tilt_deg == (0.0, 0.0) else f", turned by {self.tilt_deg[0]:g} and {self.tilt_deg[1]:g} deg"
        body = "half painted piece" if self.body == "coated" else self.body
        return f"{body}{gray} at {self.distance_mm:g} mm{tilt}"


class Stage(Protocol):
    """Puts targets where they are asked for, and tells where they really stand as far as its scale knows."""

    @property
    def reads_at_once(self) -> bool:
        """Get whether `read_scale` tells the place at the instant of the call, as a camera does, not a person."""

    def place(self, wanted: Placing) -> float:
        """Put a target up and return its distance (mm) as the stage's own scale reads it.

        Raises
        ------
        BadInput
            When this stage cannot do it.
        """

    def read_scale(self) -> tuple[float, float]:
        """Read where the spot stands on the scale of the ``scale`` target now: x and y in mm."""
