"""`Check`: one value of the dissertation, the simulator's value, its kind, and whether it is within tolerance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

Kind = Literal["put in", "fitted", "predicted", "known difference"]
KINDS: dict[Kind, str] = {
    "put in": "a parameter, or holds by construction: shows that the code does what it says, not that it is right",
    "fitted": "a parameter that the dissertation does not state was chosen so that this comes out",
    "predicted": "comes out of the rest and could have failed",
    "known difference": "comes out, and is not what the dissertation states; passes where it is as far off as is known",
}


@dataclass(frozen=True)
class Check:
    """One line of the validation.

    Attributes
    ----------
    name : str
        Quantity with its unit and the figure or section.
    dissertation : str
        Value in the dissertation.
    simulator : float
        Value of the simulator.
    low, high : float
        Bounds within which it passes; of a known difference those of the value that is known.
    kind : str
        One of `KINDS`.
    reason : str
        Why it differs, for a known difference.
    """

    name: str
    dissertation: str
    simulator: float
    low: float
    high: float
    kind: Kind
    reason: str = ""

    def __post_init__(self) -> None:
        if (self.kind == "known difference") != bool(self.reason):
            raise ValueError(f"{self.name}: a known difference needs a reason, and nothing else has one")

    @property
    def passed(self) -> bool:
        """Get whether the value lies within its bounds (NaN does not)."""
        return self.low <= self.simulator <= self.high

    def as_json(self) -> dict[str, object]:
        """Get the keys that the command prints."""
        return {
            "name": self.name,
            "dissertation": self.dissertation,
            "simulator": float(f"{self.simulator:.6g}") if abs(self.simulator) < float("inf") else None,
            "tolerance": f"{self.low:g} to {self.high:g}",
            "passed": bool(self.passed),
            "kind": self.kind,
            "reason": self.reason,
        }


@dataclass(frozen=True)
class Part:
    """Result of one part of the validation: ``checks``, and drawn ``pictures`` by file stem with their caption."""

    checks: list[Check]
    pictures: dict[str, tuple[str, Figure]]


def axes(x_label: str, y_label: str, x: tuple[float, float], y: tuple[float, float]) -> tuple[Figure, Axes]:
    """Make a picture with the axes of the dissertation's figure."""
    figure = Figure(figsize=(5.6, 3.8), layout="constrained")
    ax = figure.add_subplot()
    ax.set(xlabel=x_label, ylabel=y_label, xlim=x, ylim=y)
    ax.grid(alpha=0.3)
    return figure, ax
