"""What the demo does after the scan: register it, compare with the hidden truth, fill the report folder."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.cli.commands.register import describe
from picoradar.instrument.cli.simulated import Simulated, checked_simulation
from picoradar.instrument.events import JsonObject
from picoradar.instrument.recording import Cloud, Recording
from picoradar.instrument.report import RegisteredScan, Surface, write_report
from picoradar.instrument.settings import Settings, to_toml
from picoradar.registration import Objection, Tolerance, pose_error, prepare_model, register


@dataclass(frozen=True)
class DemoRegistration:
    """A registered scan of the simulated bench.

    Attributes
    ----------
    registered : RegisteredScan
        Its ``truth_error`` has ``rotation_deg``; ``translation_mm`` of the middle of the cloud; ``tre_mm``, the largest
        shift of any of its points; ``at_targets_mm``, that of any target.
    described : dict
        The registration by the keys of the command's contract.
    landmarks : list of dict
        Pairs that the registration started from.
    """

    registered: RegisteredScan
    described: JsonObject
    landmarks: list[JsonObject]


class DemoAsked(NamedTuple):
    """How the demo's scan is registered: method, tolerance, deviation of the common range error (mm; None: never
    measured), and what speaks against its points."""

    method: Literal["robust", "dissertation"]
    tolerance: Tolerance
    range_bias_mm: float | None
    objections: Sequence[Objection]


def register_scan(simulated: Simulated, scanned: Cloud, asked: DemoAsked) -> DemoRegistration:
    """Register a scan from clicked landmarks and compare the pose with the true one."""
    cloud = scanned.with_range()
    landmarks = simulated.landmarks()
    began = time.perf_counter()
    model = prepare_model(*simulated.model)
    prepared = time.perf_counter()
    result = register(
        cloud.points_mm,
        model,
        start=landmarks,
        covariance=cloud.covariance_mm2,
        response_mv=cloud.response_mv,
        grid=cloud.grid,
        method=asked.method,
        targets=[{"name": pair["name"], "position": pair["model"]} for pair in landmarks],
        range_bias_mm=asked.range_bias_mm,
        tolerance=asked.tolerance,
        objections=asked.objections,
    )
    done = time.perf_counter()
    targets_mm = np.array([target.position for target in result.targets])
    truth_error = _truth_error(result.model_from_scanner, simulated.model_from_scanner, cloud.points_mm, targets_mm)
    duration = {"prepare_ms": (prepared - began) * 1e3, "register_ms": (done - prepared) * 1e3}
    return DemoRegistration(
        registered=RegisteredScan(result, asked.tolerance, Surface(*simulated.model), truth_error),
        described=describe(result, asked.tolerance, **duration),
        landmarks=landmarks,
    )


def _truth_error(
    estimate: NDArray[np.float64],
    truth: NDArray[np.float64],
    points_mm: NDArray[np.float64],
    targets_mm: NDArray[np.float64],
) -> dict[str, float]:
    in_model = points_mm @ truth[:3, :3].T + truth[:3, 3]
    found = points_mm @ estimate[:3, :3].T + estimate[:3, 3]
    moved = targets_mm @ (estimate @ np.linalg.inv(truth))[:3, :3].T + (estimate @ np.linalg.inv(truth))[:3, 3]
    error = pose_error(estimate, truth, in_model.mean(axis=0))
    return {
        "rotation_deg": error.rotation_deg,
        "translation_mm": error.translation_mm,
        "tre_mm": float(np.linalg.norm(found - in_model, axis=1).max()),
        "at_targets_mm": float(np.linalg.norm(moved - targets_mm, axis=1).max()),
    }


def write_folder(folder: Path, settings: Settings, cloud: Cloud, found: DemoRegistration, summary: JsonObject) -> None:
    """Write the report and, beside it, all that is needed to do each step again by hand."""
    import trimesh

    (folder / "settings.toml").write_text(to_toml(settings, checked_simulation(settings)), encoding="utf-8")
    (folder / "landmarks.json").write_text(json.dumps(found.landmarks, indent=1) + "\n", encoding="utf-8")
    if found.registered.model is not None:
        trimesh.Trimesh(*found.registered.model, process=False).export(folder / "model.stl")
    with Recording.open(folder / "scan.db") as recording:
        write_report(folder, recording=recording, cloud=cloud, registered=found.registered, summary=summary)
