"""Scans taken by the simulated bench: drivers, firmware, physics and ranging in this process, with the hidden truth."""

from __future__ import annotations

import logging
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import structlog

from picoradar.instrument.cli import scanning, session
from picoradar.instrument.recording import Cloud, Recording
from picoradar.instrument.settings import Settings, override
from picoradar.registration.se3 import transform

structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.WARNING))


@dataclass(frozen=True)
class BenchScan:
    """One recorded scan.

    Attributes
    ----------
    cloud : Cloud
        Points that carry a range.
    truth : (4, 4) array
        True `model_from_scanner`.
    landmarks : list of dict
        As a person would click them; empty where the body has none.
    vertices, faces : (V, 3) and (F, 3) arrays
        Preoperative model, without tissue and instruments.
    """

    cloud: Cloud
    truth: np.ndarray
    landmarks: list[dict[str, Any]]
    vertices: np.ndarray
    faces: np.ndarray

    def in_model(self) -> np.ndarray:
        """Points (N, 3) at their true place in the model frame, mm."""
        return transform(self.truth, self.cloud.points_mm)


def take(seed: int, *, dress: Any = None, scan: dict[str, Any] | None = None, **simulation: Any) -> BenchScan:
    """Warm up, scan and shut down.

    Parameters
    ----------
    seed : int
        Of the bench: pose, tissue, noise.
    dress : callable, optional
        Puts another body before the scanner: called with the simulated bench before the scan, returns the bare
        model's vertices and faces.
    scan : dict, optional
        Entries of the ``[scan]`` settings.
    **simulation
        Entries of the ``[simulation]`` settings.
    """
    settings = override(Settings(), {"": {"seed": seed}, "scan": scan or {}, "simulation": simulation})
    with tempfile.TemporaryDirectory() as folder, session.session(settings, None) as run:
        bench = run.simulated
        model = bench.model if dress is None else dress(bench.bench)
        session.warm_up(run)
        scanning.record_scan(run, Path(folder) / "scan.db")
        with Recording.open(Path(folder) / "scan.db") as recording:
            cloud = recording.cloud().with_range()
        has_landmarks = dress is None and settings.simulation.get("target", "hip") == "hip"
        clicked = bench.landmarks() if has_landmarks else []
        return BenchScan(cloud, bench.model_from_scanner, clicked, *model)
