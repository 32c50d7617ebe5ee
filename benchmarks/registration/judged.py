"""Registrations with what was predicted of them and how far off they were: kept line by line, so that a run resumes."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scenes
from floor import scan_floor
from marked import provenance, write_between_marks
from success import Bone

from picoradar.registration import Model, register

LIMIT_DEG, LIMIT_MM = 1.0, 1.0
"""Right means that the rotation and the socket's centre are off by less."""

ABLE_DEG = 0.35
"""Floor of the rotation below which a scan allows a right pose."""

PLACES = ("centre", *["rim"] * 4, *["50 mm"] * 2, *["100 mm"] * 2)
"""What the targets are called, in the order of :func:`targets_of`."""


def targets_of(bone: Bone) -> np.ndarray:
    """Middle of the socket, four points of its rim, two 50 and two 100 mm away, (9, 3), socket's frame."""
    r = bone.scale * scenes.CUP_RADIUS
    rim = [[r, 0, 0], [-r, 0, 0], [0, r, 0], [0, -r, 0]]
    return np.array([[0, 0, 0], *rim, [50, 0, 0], [0, 50, -10], [0, 100, 0], [-100, 0, 0]], dtype=float)


@dataclass(frozen=True)
class Judged:
    """One registration.

    `error_mm`, `rms_mm`, `p95_mm` and `stated_mm` are at the targets; `verdict` and `reasons` are of a registration
    with the socket's centre as the only target.
    """

    bone: str
    model: str
    case: str
    seed: int
    given: str
    rotation_deg: float
    predicted_rotation_deg: float
    floor_deg: float
    floor_mm: float
    error_mm: list[float]
    rms_mm: list[float]
    p95_mm: list[float]
    stated_mm: list[float]
    verdict: str
    reason: str
    cpu_ms: float

    @property
    def right(self) -> bool:
        """Whether the pose is right at the socket."""
        return self.rotation_deg < LIMIT_DEG and self.error_mm[0] < LIMIT_MM

    @property
    def able(self) -> bool:
        """Whether the floor allows it to be."""
        return self.floor_deg < ABLE_DEG


def judged(
    bone: Bone, model: Model, model_from_cup: np.ndarray, scan: dict[str, Any], label: dict[str, Any], **given: Any
) -> Judged:
    """Register a scan; all targets for the errors, the socket's centre alone for the verdict.

    Parameters
    ----------
    given : dict
        Arguments of :func:`picoradar.registration.register`.
    """
    places = targets_of(bone)
    began = time.process_time()
    found = register(scan["points"], model, targets=scenes.apply(model_from_cup, places), **given)
    cpu_ms = (time.process_time() - began) * 1e3
    moved = scenes.inv(model_from_cup) @ found.model_from_scanner
    turn, _, _ = scenes.errors(moved, scan["T"], bone.targets)
    shift = np.linalg.norm(scenes.apply(moved @ scenes.inv(scan["T"]), places) - places, axis=1)
    floor = scan_floor(scan, bone.targets)
    verdict, reason = found.verdict, found.reasons[0]
    if verdict != "pass":  # perhaps for a target far off
        near = register(scan["points"], model, targets=scenes.apply(model_from_cup, places[:1]), **given)
        verdict, reason = near.verdict, near.reasons[0]
    return Judged(
        **label,
        rotation_deg=turn,
        predicted_rotation_deg=found.predicted_rotation_deg,
        floor_deg=floor["rot_deg"],
        floor_mm=floor["shift_mm"],
        error_mm=shift.tolist(),
        rms_mm=[t.rms_mm for t in found.targets],
        p95_mm=[t.p95_mm for t in found.targets],
        stated_mm=[t.stated_mm for t in found.targets],
        verdict=verdict,
        reason=reason,
        cpu_ms=cpu_ms,
    )


class Kept:
    """Results in a file of JSON lines: what is there is not measured again."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.done: list[Judged] = []
        if path.is_file():
            lines = path.read_text(encoding="utf-8").splitlines()
            self.done = [Judged(**json.loads(line)) for line in lines if line.endswith("}")]
        self.known = {self._key(asdict(one)) for one in self.done}

    def __contains__(self, label: dict[str, Any]) -> bool:
        return self._key(label) in self.known

    def add(self, one: Judged) -> None:
        """Keep a result."""
        self.done.append(one)
        self.known.add(self._key(asdict(one)))
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(one)) + "\n")

    def tell(self, lines: list[str], name: str, *, write: bool) -> None:
        """Print a table of them, and put it into the documentation in the place of this benchmark."""
        print(*lines, sep="\n")
        if write:
            write_between_marks(
                "registration.md", name, [f"{provenance()} {len(self.done)} registrations.", "", *lines]
            )

    @staticmethod
    def _key(label: dict[str, Any]) -> tuple[Any, ...]:
        return tuple(label[name] for name in ("bone", "model", "case", "seed", "given"))


def column(rows: list[Judged], name: str) -> np.ndarray:
    """One field of all rows."""
    return np.array([getattr(row, name) for row in rows])


def coverage(rows: list[Judged], name: str = "p95_mm") -> np.ndarray:
    """Whether each error was inside what was stated, (rows, targets)."""
    return np.asarray(column(rows, "error_mm") <= column(rows, name))


def ratio(rows: list[Judged]) -> float:
    """Root mean square of the errors over that predicted, over all targets: each target counts the same."""
    actual, predicted = column(rows, "error_mm"), column(rows, "rms_mm")
    return float(np.sqrt(np.mean((actual**2).mean(axis=0) / (predicted**2).mean(axis=0))))
