"""Bench procedures on the simulated bench, with few readings: what they find, and what they say of a wrong bench."""

from __future__ import annotations

import datetime
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar.drivers.interfaces import Record, SweepSettings
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.cli.light_meters import light_meters
from picoradar.instrument.cli.person import Person
from picoradar.instrument.cli.session import Session, session
from picoradar.instrument.cli.stages import SimulatedStage
from picoradar.instrument.procedures import distance, drift, transmitter
from picoradar.instrument.procedures.geometry import Pose
from picoradar.instrument.procedures.geometry import procedure as geometry
from picoradar.instrument.procedures.gray_target import procedure as gray_target
from picoradar.instrument.procedures.gray_target import templates
from picoradar.instrument.procedures.penetration import procedure as penetration
from picoradar.instrument.procedures.prism import procedure as prism
from picoradar.instrument.procedures.scanner import procedure as scanner
from picoradar.instrument.procedures.station import Outcome, Placing, Radar, Station, write_outcome
from picoradar.instrument.settings import Settings, override
from picoradar.sim.physics import Transmitter
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.wires import Acquisition

DATE = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
ECHO_FROM_PS = 9000.0
Small = Callable[[Station], Outcome]
SMALL: dict[str, Small] = {
    "gray-target": lambda s: gray_target.run(s, levels=12, readings=80),
    "templates": lambda s: templates.run(s, levels=3, readings=30),
    "geometry": lambda s: geometry.run(s, points_a_side=7),
    "prism": lambda s: prism.run(s, thin=8),
    "distance": lambda s: distance.run(s, readings=60, short=24),
    "drift": lambda s: drift.run(s, hours=0.5, interval_s=180.0, readings=6),
    "scanner": lambda s: scanner.run(s, steps=10, repeats=8),
    "transmitter": lambda s: transmitter.run(s, volts=(270.0, 290.0), degc=(23.0,)),
    "penetration": lambda s: penetration.run(s, tilts_deg=(0.0,), step_mm=2.0),
}
FEWER: dict[str, Small] = {  # enough to see that something else stands there
    "drift": lambda s: drift.run(s, hours=0.05, interval_s=18.0, readings=2),
    "prism": lambda s: prism.run(s, thin=12),
    "gray-target": lambda s: gray_target.run(s, levels=3, readings=10),
    "templates": lambda s: templates.run(s, levels=2, readings=10),
}
RIDGE_OFF = r"\b(19|20) mm off"  # the ridge is 20 mm before the middle; the spot sees its sides too
RANGING = sorted(SMALL.keys() - {"scanner", "transmitter"})


@pytest.fixture
def bench() -> Iterator[Session]:
    """A warm simulated bench; each test has its own, so that its noise does not depend on what ran before."""
    with session(override(Settings(), {"simulation": {"target": "plate"}}), None) as run:
        run.controller.warm_up()
        yield run


@pytest.fixture
def station(bench: Session, tmp_path: Path) -> Station:
    assert bench.simulated is not None
    return make_station(bench, SimulatedStage(bench.simulated), tmp_path)


def make_station(bench: Session, stage: Any, folder: Path) -> Station:
    assert bench.simulated is not None
    meters = light_meters(bench, Person(bench.controller.rest))
    radar = Radar(bench.controller, bench.settings, bench.calibration, bench.identities, seed=1)
    return Station(radar, stage, folder, lambda _share, _note: None, date=DATE, meters=meters)


def test_gray_target_makes_a_calibration_that_holds_on_cards_held_back(station: Station) -> None:
    outcome = SMALL["gray-target"](station)
    assert outcome.passed, outcome.findings
    assert outcome.calibration is not None
    assert outcome.calibration.date == DATE
    assert outcome.calibration.serial_numbers["sampler"] == "SB-0001"
    assert outcome.calibration.range_zero_mm == pytest.approx(station.calibration.range_zero_mm, abs=0.03)
    assert outcome.calibration.range_zero_sd_mm == pytest.approx(
        0.112, abs=0.003
    )  # 0.05 of the stage, 0.1 from day to day
    assert outcome.calibration.materials == station.calibration.materials  # the step against paint outlives the zero
    assert outcome.calibration.pointing_sd_rad == station.calibration.pointing_sd_rad


def test_geometry_says_what_it_knows_and_writes_a_whole_report(station: Station, bench: Session) -> None:
    outcome = SMALL["geometry"](station)
    assert outcome.passed, outcome.findings
    assert outcome.figures["y_offset_rad"] is None
    assert outcome.calibration is not None
    assert outcome.calibration.geometry is not None
    zero_sd_mm = outcome.calibration.geometry.sd["range_zero_mm"]
    assert outcome.calibration.range_zero_sd_mm == pytest.approx((zero_sd_mm**2 + 0.1**2) ** 0.5)
    assert abs(float(outcome.figures["x_scale"] or 0)) < 4 * float(outcome.figures["x_scale_sd"] or 0)
    result = write_outcome(station.folder, outcome, settings=bench.settings, seed=1)
    names = {path.name for path in station.folder.iterdir()}
    assert {"report.html", "figures.json", "settings.toml", "calibration.json", "points.csv", "residuals.png"} <= names
    assert json.loads((station.folder / "figures.json").read_text())["passed"] is True
    page = (station.folder / "report.html").read_text(encoding="utf-8")
    assert "PASSED" in page
    assert 'src="http' not in page
    assert Calibration.load(Path(result["calibration"])).digest == outcome.calibration.digest  # type: ignore[union-attr]


def test_prism_points_lie_within_the_limits(station: Station) -> None:
    outcome = SMALL["prism"](station)
    assert outcome.passed, outcome.findings
    assert float(outcome.figures["template_perpendicular_mean_mm"] or 9) < 0.12
    assert float(outcome.figures["half_maximum_within_1_mm_share"] or 0) > 0.95


def test_distances_are_right_from_62_to_100_cm(station: Station) -> None:
    outcome = SMALL["distance"](station)
    assert outcome.passed, outcome.findings
    assert float(outcome.figures["template_largest_mean_over_distance_mm"] or 9) < 0.1
    assert float(outcome.figures["half_maximum_overlap_limit_mm"] or 999) <= 640


def test_the_scanner_settles_in_the_times_in_force(station: Station) -> None:
    outcome = SMALL["scanner"](station)
    assert outcome.passed, outcome.findings
    assert 0.2 < float(outcome.figures["flyback_error_after_2_ms_mm"] or 0) < 0.6


def test_the_reference_takes_the_drift_out(station: Station) -> None:
    outcome = SMALL["drift"](station)
    assert outcome.passed, outcome.findings
    assert float(outcome.figures["largest_without_reference_mm"] or 0) > 5 * float(
        outcome.figures["largest_with_reference_mm"] or 9
    )
    assert float(outcome.figures["reference_once_largest_in_18_min_mm"] or 0) > 0.5
    assert any("a reference taken once" in found for found in outcome.findings)


def test_templates_scatter_less_than_half_maxima(station: Station) -> None:
    outcome = SMALL["templates"](station)
    assert outcome.passed, outcome.findings
    assert outcome.calibration is not None
    assert "template" not in outcome.calibration.walk  # it goes with the shapes


def test_the_working_point_of_the_transmitter_is_found(station: Station) -> None:
    outcome = SMALL["transmitter"](station)
    assert outcome.passed, outcome.findings
    assert outcome.figures["working_drive_v"] == 290.0
    assert float(outcome.figures["fwhm_ps"] or 0) == pytest.approx(44, abs=1.5)
    assert station.controller.settings.pulser.drive_v == station.settings.pulser.drive_v


def test_the_current_pulse_is_measured_across_its_resistor(station: Station, bench: Session) -> None:
    """At both rates as figure 2.7; truth from the simulated transmitter (290 V, 23 degC)."""
    outcome = SMALL["transmitter"](station)
    assert bench.simulated is not None
    current = Transmitter(SimulationSettings()).current
    names = ("peak_a", "fwhm_ns", "rise_ns")
    for khz in (20, 80):
        truth = current(290.0, 23.0, khz * 1e3)
        found = [float(outcome.figures[f"current_{name}_at_{khz}_khz"] or 0) for name in names]
        assert found == pytest.approx([truth.peak_a, truth.fwhm_ns, truth.rise_ns], rel=0.004)
    assert float(outcome.figures["current_delay_ns"] or 0) == pytest.approx(0.2, abs=0.02)
    assert "current" in {plot.name for plot in outcome.plots}


def test_the_calibration_that_ships_fits_the_simulator(station: Station) -> None:
    for gray, limit_mm in ((0.7, 0.05), (0.35, 0.05), (0.25, 0.10)):
        reported_mm = station.stage.place(Placing("card", 900.0, gray=gray))
        measured = station.dwell(f"card-{gray}", 60)
        for method, allowed in (("template", limit_mm), ("half-maximum", limit_mm + 0.15)):
            error = measured.reprocessed(method, station.calibration).with_range().range_mm - reported_mm
            assert abs(float(error.mean())) < allowed, (gray, method)


# ---- what noise allows to judge


@pytest.mark.parametrize(
    "few",
    [
        pytest.param(lambda s: distance.run(s, readings=20, short=6), marks=pytest.mark.slow),
        lambda s: drift.run(s, hours=0.05, interval_s=18.0, readings=2),
        lambda s: gray_target.run(s, levels=5, readings=20),
    ],
    ids=["distance", "drift", "gray-target"],
)
def test_readings_that_are_too_few_end_without_a_verdict(station: Station, few: Small) -> None:
    outcome = few(station)
    assert not outcome.passed
    assert any(re.search(r"too few to judge .* Take [\d.]+ times as many", f) for f in outcome.findings), (
        outcome.findings
    )


def test_a_mean_that_is_off_is_named_with_its_limit(bench: Session, tmp_path: Path) -> None:
    bench.calibration = bench.calibration.model_copy(
        update={"range_zero_mm": bench.calibration.range_zero_mm + 0.6, "geometry": None}
    )
    assert bench.simulated is not None
    outcome = SMALL["distance"](make_station(bench, SimulatedStage(bench.simulated), tmp_path))
    assert not outcome.passed
    found = [
        re.search(r"template estimator the mean at .* is \+(0\.\d\d) mm off; 0\.3 mm", f) for f in outcome.findings
    ]
    off = [float(match[1]) for match in found if match]
    assert off == [pytest.approx(0.6, abs=0.1)]


def test_a_card_held_back_that_is_off_is_named_with_its_limit(bench: Session, tmp_path: Path) -> None:
    assert bench.simulated is not None
    stage = EverySecond(SimulatedStage(bench.simulated), off_mm=1.0)
    outcome = gray_target.run(make_station(bench, stage, tmp_path), levels=5, readings=50)
    assert not outcome.passed
    words = r"By the template estimator a card from 25 to 65 mV is wrong by (\d\.\d+) mm; allowed are 0\.050 mm"
    found = [match[1] for f in outcome.findings if (match := re.search(words, f))]
    assert [float(one) for one in found] == [pytest.approx(1.0, abs=0.25)]  # five cards leave 0.15 mm of the walk


class EverySecond:
    """Reports every second body at a place that is off by so much."""

    reads_at_once = True

    def __init__(self, stage: SimulatedStage, *, off_mm: float) -> None:
        self._stage, self._off_mm, self._placed = stage, off_mm, 0

    def place(self, wanted: Placing) -> float:
        self._placed += 1
        return self._stage.place(wanted) + (self._off_mm if self._placed % 2 == 0 else 0.0)

    def read_scale(self) -> tuple[float, float]:
        return self._stage.read_scale()


# ---- a bench that is not as asked for


class WrongStage:
    """Puts up something else than asked for, and may lose readings of the scale."""

    reads_at_once = True

    def __init__(
        self, stage: SimulatedStage, body: str = "plate", distance_mm: float | None = None, *, lost_every: int = 0
    ) -> None:
        self._stage, self._body, self._distance_mm, self._lost_every = stage, body, distance_mm, lost_every
        self._readings = 0

    def place(self, wanted: Placing) -> float:
        gray = None if self._body == "coated" else 0.5
        self._stage.place(Placing(self._body, self._distance_mm or wanted.distance_mm, gray=gray))
        return wanted.distance_mm

    def read_scale(self) -> tuple[float, float]:
        self._readings += 1
        lost = self._lost_every and self._readings % self._lost_every == 0
        return (float("nan"), float("nan")) if lost else self._stage.read_scale()


class WrongMeters:
    """Light meters that see nothing every so many times: the detector, the power meter, or both."""

    def __init__(self, meters: Any, *, dark_every: int = 0, unpowered_every: int = 0) -> None:
        self._meters, self._dark_every, self._unpowered_every = meters, dark_every, unpowered_every
        self._traces = self._powers = 0
        self.open, self.close = meters.open, meters.close

    def trace(self, sweep: SweepSettings) -> Record:
        self._traces += 1
        record: Record = self._meters.trace(sweep)
        dark = np.full_like(record.sums, round(record.zero_code * record.sweeps))
        return replace(record, sums=dark) if self._dark_every and self._traces % self._dark_every == 0 else record

    def current(self, sweep: SweepSettings) -> tuple[Record, float] | None:
        return self._meters.current(sweep)  # type: ignore[no-any-return]

    def mean_power_mw(self, where: str, wait: Any) -> float:
        self._powers += 1
        lost = self._unpowered_every and self._powers % self._unpowered_every == 0
        return 0.0 if lost else float(self._meters.mean_power_mw(where, wait))


@pytest.fixture
def losing(bench: Session) -> Iterator[Callable[[int], None]]:
    """Take the echo out of every so many records, as a lid (1) or a bad contact (2) does."""
    assert bench.simulated is not None
    hooks = bench.simulated.bench.signal.after
    before = list(hooks)

    def begin(every: int) -> None:
        def hook(sums: np.ndarray, wanted: Acquisition) -> np.ndarray:
            if wanted.key[0] % every:
                return sums
            dark = wanted.delay_ps + wanted.step_ps * np.arange(wanted.samples) > ECHO_FROM_PS
            noise = np.random.default_rng(wanted.key).normal(32.0 * wanted.sweeps, wanted.sweeps**0.5, wanted.samples)
            return np.where(dark, np.rint(noise).astype(sums.dtype), sums)

        hooks.append(hook)

    yield begin
    hooks[:] = before


@pytest.mark.parametrize("name", RANGING)
@pytest.mark.parametrize("every", [1, 2], ids=["closed lid", "half the readings lost"])
def test_a_closed_lid_and_lost_readings_end_with_a_finding(
    station: Station, losing: Callable[[int], None], name: str, every: int
) -> None:
    losing(every)
    refused(FEWER.get(name, SMALL[name])(station), "have no range")


@pytest.mark.parametrize("name", RANGING)
def test_a_target_out_of_range_ends_with_a_finding(bench: Session, tmp_path: Path, name: str) -> None:
    assert bench.simulated is not None
    stage = WrongStage(SimulatedStage(bench.simulated), "plate", 1900.0)
    refused(FEWER.get(name, SMALL[name])(make_station(bench, stage, tmp_path)), "have no range")


@pytest.mark.parametrize(
    ("name", "body", "distance_mm", "words"),
    [
        ("gray-target", "plate", None, "no series of gray cards"),
        ("gray-target", "prism", None, "no series of gray cards"),
        ("templates", "plate", None, "no series of gray cards"),
        ("geometry", "step", None, "not flat"),
        ("geometry", "prism", None, "no range"),  # it fills a tenth of the scan
        ("geometry", "plate", 850.0, "was found at 850"),
        ("prism", "plate", None, "another body"),
        ("distance", "prism", None, RIDGE_OFF),
        ("distance", "plate", 950.0, "50 mm off"),
        ("drift", "prism", None, RIDGE_OFF),
        ("drift", "plate", None, "not darker"),
        ("scanner", "plate", 1900.0, "does not follow the beam"),
        ("penetration", "plate", None, "equally bright and equally far"),
        ("penetration", "step", None, "more than any tissue"),
        ("penetration", "prism", None, "no flat piece"),
        ("penetration", "coated", 850.0, "was found at 850"),
    ],
)
def test_a_wrong_target_ends_with_a_finding(
    bench: Session, tmp_path: Path, name: str, body: str, distance_mm: float | None, words: str
) -> None:
    assert bench.simulated is not None
    stage = WrongStage(SimulatedStage(bench.simulated), body, distance_mm)
    refused(FEWER.get(name, SMALL[name])(make_station(bench, stage, tmp_path)), words)


@pytest.mark.parametrize("every", [1, 2], ids=["no scale on the plate", "half the readings lost"])
def test_a_scale_that_cannot_be_read_ends_with_a_finding(bench: Session, tmp_path: Path, every: int) -> None:
    assert bench.simulated is not None
    stage = WrongStage(SimulatedStage(bench.simulated), lost_every=every)
    refused(SMALL["scanner"](make_station(bench, stage, tmp_path)), "does not meet the scale")


@pytest.mark.parametrize(
    "faults",
    [{"dark_every": 1, "unpowered_every": 1}, {"dark_every": 1}, {"unpowered_every": 1}, {"dark_every": 2}],
    ids=["closed lid", "detector elsewhere", "power meter elsewhere", "half the readings lost"],
)
def test_meters_without_light_end_with_a_finding(station: Station, faults: dict[str, int]) -> None:
    station.meters = WrongMeters(station.meters, **faults)
    refused(SMALL["transmitter"](station), "No light")


def refused(outcome: Outcome, words: str) -> None:
    assert not outcome.passed
    assert outcome.calibration is None
    assert any(re.search(words, finding) for finding in outcome.findings), outcome.findings
    assert outcome.next_step


def test_one_pose_alone_leaves_the_separation_unknown(station: Station) -> None:
    assert geometry.run(station, poses=(Pose(800.0),), points_a_side=7).figures["mirror_separation_mm"] is None
