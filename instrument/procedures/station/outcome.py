"""`Outcome`: what a procedure found, in words, figures, tables and pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Calibration

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Draw = Callable[["Figure"], None]


@dataclass(frozen=True)
class Plot:
    """A picture of the report.

    Attributes
    ----------
    name : str
        Name of the PNG file, without its ending.
    title, caption : str
        What it is, and what one sees in it.
    draw : callable
        Draws into an empty matplotlib figure.
    size_in : (float, float)
        Width and height, inches.
    """

    name: str
    title: str
    caption: str
    draw: Draw
    size_in: tuple[float, float] = (9.0, 4.2)


@dataclass(frozen=True)
class Readings:
    """Raw readings as a table: column names with their units, and an (N, K) array."""

    columns: tuple[str, ...]
    values: NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """Result of a bench procedure.

    Attributes
    ----------
    name : str
        The procedure's name on the command line.
    passed : bool
        Whether it keeps its own limits.
    findings : sequence of str
        What was found, the most important first; for a bench that does not fit, what is wrong with it.
    next_step : str
        What a person should do now.
    headline : (str, str)
        The one figure, with its unit, and what it is.
    figures : mapping
        Name (with the unit in it) to value; None where a number could not be had.
    plots : sequence of Plot
    readings : mapping
        File name without ending to table.
    calibration : Calibration or None
        What was calibrated.
    """

    name: str
    passed: bool
    findings: Sequence[str]
    next_step: str
    headline: tuple[str, str]
    figures: Mapping[str, float | int | str | bool | None]
    plots: Sequence[Plot] = ()
    readings: Mapping[str, Readings] = field(default_factory=dict)
    calibration: Calibration | None = None
