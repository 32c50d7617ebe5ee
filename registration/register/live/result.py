"""`LiveResult`: what the lines so far say of the pose."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from picoradar.registration._types import FloatArray
from picoradar.registration.trust import Registration, Target

Stage = Literal["waiting", "searched", "followed", "confirmed"]


@dataclass(frozen=True)
class LiveResult:
    """The state of a live registration after a line; it never changes, so any thread may keep it.

    Attributes
    ----------
    stage : {"waiting", "searched", "followed", "confirmed"}
        Whether the pose is missing yet, comes from a search, was refined from that of the line before, or is that of a
        whole batch registration of these lines.
    why : str
        Why there is no pose, or why it was looked for anew; else empty.
    lines : tuple of int
        Rows of the lines that it is of, in the order in which they came.
    points : int
        Their points that have a range.
    searches : int
        Searches so far.
    registration : Registration or None
        Pose, covariance, predicted errors and verdict; its arrays over points are of the points that it followed.
    """

    stage: Stage = "waiting"
    why: str = "no line yet"
    lines: tuple[int, ...] = ()
    points: int = 0
    searches: int = 0
    registration: Registration | None = None

    @property
    def model_from_scanner(self) -> FloatArray | None:
        """Get the pose (4, 4), if there is one."""
        return None if self.registration is None else self.registration.model_from_scanner

    @property
    def verdict(self) -> str | None:
        """Get the verdict so far; None without a pose."""
        return None if self.registration is None else self.registration.verdict

    @property
    def targets(self) -> list[Target]:
        """Get the targets with their predicted errors; none without a pose."""
        return [] if self.registration is None else list(self.registration.targets)

    @property
    def worst_tre_mm(self) -> float:
        """Get the largest predicted error of all targets, see `tre_mm`; infinite without a pose."""
        return max(map(tre_mm, self.targets), default=math.inf)

    def reaches(self, until_tre_mm: float | None) -> bool:
        """Get whether the verdict is ``pass``, and the error at every target at most so many mm, if that is asked."""
        return self.verdict == "pass" and (until_tre_mm is None or self.worst_tre_mm <= until_tre_mm)


def tre_mm(target: Target) -> float:
    """Return the predicted root mean square error at a target, a common range error included; infinite if that was
    never measured."""
    return math.hypot(target.rms_mm, target.bias_mm) if math.isfinite(target.bias_mm) else math.inf
