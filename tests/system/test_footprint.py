"""Points whose spot sees two surfaces are flagged in rasters of any step, and in nothing but rasters."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar.instrument.acquisition import reprocess
from picoradar.instrument.cli.scanning import record_scan, resume_scan
from picoradar.instrument.cli.session import Session, session
from picoradar.instrument.cli.stages import SimulatedStage
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import Flag
from picoradar.instrument.procedures.station import Placing, Radar, Station
from picoradar.instrument.recording import Cloud, Recording
from picoradar.instrument.settings import Settings, override


def scan(path: Path, target: str, step_mm: float, columns: int) -> Cloud:
    scan = {"rows": 4, "columns": columns, "step_mm": step_mm}
    with session(override(Settings(), {"scan": scan, "simulation": {"target": target}}), None) as run:
        run.controller.warm_up()
        return record_scan(run, path).cloud


def mixed(cloud: Cloud) -> np.ndarray:
    return (cloud.flags & np.uint16(Flag.MIXED)) != 0


@pytest.mark.parametrize("step_mm", [0.01, 0.05, 0.1, 1.0])
def test_a_plate_is_one_surface_at_every_step(tmp_path: Path, step_mm: float) -> None:
    cloud = scan(tmp_path / "plate.db", "plate", step_mm, 40)
    assert cloud.has_range.all()
    assert mixed(cloud).sum() == 0


@pytest.mark.parametrize(("step_mm", "columns"), [(1.0, 20), (0.1, 40)])
def test_an_edge_is_found_at_every_step(tmp_path: Path, step_mm: float, columns: int) -> None:
    cloud = scan(tmp_path / "step.db", "step", step_mm, columns)
    between = (cloud.range_mm > 891.5) & (cloud.range_mm < 898.5)  # the surfaces lie at 890 and 900 mm
    assert between.any() or step_mm == 1.0
    assert mixed(cloud)[between].all()
    x_mm = cloud.points_mm[:, 0]
    edges_mm = [np.ptp(x_mm[mixed(cloud) & (cloud.rows == row)]) for row in range(4)]
    assert all(0.4 < width_mm < 1.6 for width_mm in edges_mm)  # a spot, and half a one on either side


def test_the_outer_edge_of_the_prism_is_found_and_its_faces_are_not(tmp_path: Path) -> None:
    cloud = scan(tmp_path / "prism.db", "prism", 1.0, 60)
    for row in range(4):
        seen = cloud.columns[(cloud.rows == row) & cloud.has_range]
        assert cloud.columns[(cloud.rows == row) & mixed(cloud)].tolist() == [seen.min(), seen.max()]


@pytest.fixture
def with_station(tmp_path: Path) -> Callable[[Callable[[Station, Session], Any]], Any]:
    def run_with(what: Callable[[Station, Session], Any]) -> Any:
        with session(override(Settings(), {"simulation": {"target": "plate"}}), None) as run:
            run.controller.warm_up()
            assert run.simulated is not None
            radar = Radar(run.controller, run.settings, run.calibration, run.identities, seed=1)
            return what(Station(radar, SimulatedStage(run.simulated), tmp_path, lambda _share, _note: None), run)

    return run_with


def test_a_fixed_point_acquisition_is_no_raster(with_station: Any, tmp_path: Path) -> None:
    def dwell(station: Station, run: Session) -> None:
        station.stage.place(Placing("plate", 900.0))
        measured = station.dwell("dwell", 60)
        assert len(measured.cloud) == 100
        assert np.ptp(measured.cloud.range_mm) > 0.5  # noise there is
        assert not mixed(measured.cloud).any()

    with_station(dwell)
    path = tmp_path / "raw" / "dwell.db"
    with Recording.open(path) as recording:
        assert recording.raster["plan"] == "points"
        assert "step_mm" not in recording.raster
        assert not mixed(recording.cloud()).any()
    reprocess(path, tmp_path / "template.db", method="template")
    with Recording.open(tmp_path / "template.db") as recording:
        assert not mixed(recording.cloud()).any()


def test_what_is_measured_is_what_is_recorded(with_station: Any, tmp_path: Path) -> None:
    def monitor(station: Station, run: Session) -> Any:
        return station.monitor("monitor", groups=3, readings=2, interval_s=30.0)

    measured = with_station(monitor)
    with Recording.open(tmp_path / "raw" / "monitor.db") as recording:
        assert recording.raster["interval_s"] == 30.0
        assert np.diff([line.device_time_s for line in recording.lines()]) == pytest.approx([30.0, 30.0], abs=0.1)
        for line, read in zip(measured.lines, recording.lines(), strict=True):
            assert np.array_equal(line.traces.mv, read.traces.mv)
            assert np.array_equal(line.traces.times_ps, read.traces.times_ps)
            assert np.array_equal(line.points_mm, read.points_mm)
            assert np.array_equal(line.beams, read.beams)


def test_a_recording_of_a_procedure_is_not_resumed_as_a_raster(with_station: Any, tmp_path: Path) -> None:
    def again(station: Station, run: Session) -> None:
        path = station.dwell("dwell", 4).recording
        with pytest.raises(BadInput, match="points"):
            resume_scan(run, path)

    with_station(again)
