"""From a half painted piece of bone to a verdict: what is measured, taken off, recorded, and stated."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.cli.main import run as command
from picoradar.instrument.cli.session import calibration_of, session
from picoradar.instrument.cli.stages import SimulatedStage
from picoradar.instrument.line import SUSPECT
from picoradar.instrument.procedures.penetration import procedure as penetration
from picoradar.instrument.procedures.station import Outcome, Placing, Radar, Station
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Settings, override

COAT_MM = 0.5
Called = tuple[int, dict[str, Any]]
CLINIC = {"world": "clinic", "tissue_sample": 4, "coat_mm": COAT_MM}


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Callable[..., Called]:
    def _call(*arguments: object) -> Called:
        capsys.readouterr()
        code = command([*map(str, arguments), "--json"])
        return code, json.loads(capsys.readouterr().out)

    return _call


def measured(folder: Path, simulation: dict[str, object], stage: Callable[..., Any] = SimulatedStage) -> Outcome:
    settings = override(Settings(), {"": {"seed": 3}, "simulation": simulation})
    with session(settings, None) as run:
        run.controller.warm_up()
        radar = Radar(run.controller, settings, run.calibration, run.identities, 3)
        station = Station(radar, stage(run.simulated), folder, lambda *_: None)
        return penetration.run(station, coat_mm=COAT_MM, tilts_deg=(0.0,), step_mm=2.0)


def test_the_procedure_recovers_the_truth_of_the_very_piece(tmp_path: Path) -> None:
    """Bare points less painted ones, each against its own hidden range: that is the bias, whatever the range zero."""
    outcome = measured(tmp_path, CLINIC)
    assert outcome.passed, outcome.findings
    assert outcome.calibration is not None
    truth = true_bias_mm(tmp_path / "true.db", CLINIC)
    assert 2.0 < truth < 4.5
    for ranging, entry in outcome.calibration.materials["bone"].items():
        if ranging != "template":  # the same piece, ranged as the scan is
            assert entry.bias_mm == pytest.approx(truth, abs=3 * entry.sample_sd_mm), ranging
        assert entry.sample_sd_mm < 0.15
        assert entry.transfer_sd_mm == pytest.approx(2**0.5 * 0.08 * entry.bias_mm)
        if entry.stretch is not None:  # bone differs from place to place, and the report says by how much
            assert 0.2 < entry.stretch.place_sd_mm < 1.0
            assert outcome.figures[f"{ranging}_place_sd_mm"] == entry.stretch.place_sd_mm
            assert any("From place to place" in finding for finding in outcome.findings)


def true_bias_mm(path: Path, simulation: dict[str, object]) -> float:
    """Mean range error of the bare half less that of the painted half, by the simulator's hidden truth."""
    from picoradar.instrument.cli.scanning import record_scan

    changes = {"scan": {"rows": 9, "columns": 19, "step_mm": 2.0}, "simulation": {**simulation, "target": "coated"}}
    with session(override(Settings(), {"": {"seed": 3}, **changes}), None) as run:
        run.controller.warm_up()
        _, _, cloud = record_scan(run, path)
        assert run.simulated is not None
        runs = cloud.rows.astype(np.int64) * 19 + cloud.columns + 1
        error = cloud.range_mm - run.simulated.bench.truth.ranges_mm(runs)
    x = cloud.points_mm[:, 0]
    return float(np.nanmean(error[x > 4.0]) - np.nanmean(error[x < -4.0]))


def test_where_no_light_enters_nothing_is_taken_off_and_that_is_said(tmp_path: Path) -> None:
    outcome = measured(tmp_path, {"coat_mm": COAT_MM})
    assert outcome.passed, outcome.findings
    assert outcome.calibration is not None
    for entry in outcome.calibration.materials["bone"].values():
        assert abs(entry.bias_mm) < 3 * entry.sample_sd_mm
        assert entry.transfer_sd_mm < 0.02
        assert "no light was seen to enter" in entry.method
    assert any("No light was seen to enter" in finding for finding in outcome.findings)


class TurnedRound:
    """Puts the piece up the wrong way round."""

    reads_at_once = True

    def __init__(self, simulated: Any) -> None:
        self._bench = simulated.bench

    def place(self, wanted: Placing) -> float:
        self._bench.place("coated", (0.0, 0.0, wanted.distance_mm, 0.0, 0.0, 180.0))
        return wanted.distance_mm


def test_a_piece_the_wrong_way_round_ends_with_a_finding(tmp_path: Path) -> None:
    outcome = measured(tmp_path, CLINIC, TurnedRound)
    assert outcome.calibration is None
    assert "halves are exchanged" in outcome.findings[0]
    assert "painted half on the left" in outcome.next_step


def test_both_shipped_calibrations_know_bone_and_each_goes_with_its_world() -> None:
    opaque, clinic = (calibration_of(override(Settings(), {"simulation": s})) for s in ({}, {"world": "clinic"}))
    late = calibration_of(override(Settings(), {"simulation": {"tissue_light": True}}))
    assert late.digest == clinic.digest != opaque.digest
    for ranging in ("half-maximum", "template", "window"):
        assert abs(opaque.materials["bone"][ranging].bias_mm) < 0.2
        assert 2.0 < clinic.materials["bone"][ranging].bias_mm < 4.5
        assert 0.3 < clinic.range_error("bone", ranging).sd_mm < 0.6  # type: ignore[operator]
        assert 0.1 <= opaque.range_error("bone", ranging).sd_mm < 0.2  # type: ignore[operator]


def of_lines(recording: Recording) -> np.ndarray:
    """Ranges before the correction by the form of the echoes, which takes the whole scan."""
    return np.concatenate([line.range_mm for line in recording.lines(traces=False)])


@pytest.mark.parametrize("mode", ["sweep", "window"])
def test_what_is_scanned_as_bone_is_ranged_so_and_the_recording_says_it(
    call: Callable[..., Called], tmp_path: Path, mode: str
) -> None:
    settings = tmp_path / "clinic.toml"
    settings.write_text('[simulation]\nworld = "clinic"\n')
    small = ("scan", "--settings", settings, "--grid", "6x8", "--mode", mode)
    _, plain = call(*small, "-o", tmp_path / "plain.db")
    _, bone = call(*small, "-o", tmp_path / "bone.db", "--material", "bone")
    known = bone["range_error"]
    assert plain["range_error"] == {"material": "", "bias_mm": 0.0, "sd_mm": None}
    with Recording.open(tmp_path / "plain.db") as one, Recording.open(tmp_path / "bone.db") as other:
        off = of_lines(one) - of_lines(other)
        sd_mm = float(np.sqrt(np.mean(one.cloud().range_variance_mm2) + np.mean(other.cloud().range_variance_mm2)))
        assert other.range_error == known
        assert other.header["settings"]["scan"]["material"] == "bone"
        assert one.header["calibration_digest"] == other.header["calibration_digest"]
    # Windows lie where the surface is expected, as many as the noise asks for: other samples, with their own noise.
    np.testing.assert_allclose(off[np.isfinite(off)], known["bias_mm"], atol=1e-9 if mode == "sweep" else 5 * sd_mm)
    if mode == "sweep":
        assert off.mean() == pytest.approx(known["bias_mm"], abs=1e-9)
    assert known["bias_mm"] > 2.0

    # ranged again: as it was, as bone, and as what nobody has measured
    for name, material in (("again", None), ("as-bone", "bone"), ("as-fat", "fat")):
        source = "bone" if material is None else "plain"
        extra = () if material is None else ("--material", material)
        code, found = call("reprocess", tmp_path / f"{source}.db", "-o", tmp_path / f"{name}.db", *extra)
        assert code == 0
        if material == "fat":
            assert found["range_error"] == {"material": "fat", "bias_mm": 0.0, "sd_mm": None}
            continue
        if material is None or mode == "sweep":
            assert found["range_error"] == known
        else:  # by the stretch of other samples
            assert found["range_error"]["bias_mm"] == known["bias_mm"]
            assert found["range_error"]["stretch"] == pytest.approx(known["stretch"], abs=4 * known["stretch_sd"])
        with Recording.open(tmp_path / f"{source}.db") as one, Recording.open(tmp_path / f"{name}.db") as other:
            off = of_lines(one) - of_lines(other)
        # As bone, stretched echoes no longer pass for noise, which weighs the same samples in another way.
        atol = 1e-6 if material is None or mode == "sweep" else 2 * sd_mm
        np.testing.assert_allclose(off[np.isfinite(off)], 0.0 if source == "bone" else known["bias_mm"], atol=atol)


def test_in_windows_as_much_is_taken_off(call: Callable[..., Called], tmp_path: Path) -> None:
    """Tissue that nobody has named passes for two surfaces in places; the others differ by the bias."""
    settings = tmp_path / "clinic.toml"
    settings.write_text('[simulation]\nworld = "clinic"\n')
    off = []
    for seed in range(1, 7):
        small = ("scan", "--settings", settings, "--grid", "6x8", "--mode", "window", "--seed", seed)
        call(*small, "-o", tmp_path / f"plain-{seed}.db")
        _, bone = call(*small, "-o", tmp_path / f"bone-{seed}.db", "--material", "bone")
        paths = (tmp_path / f"{name}-{seed}.db" for name in ("plain", "bone"))
        with Recording.open(next(paths)) as one, Recording.open(next(paths)) as other:
            doubtful = ((one.cloud().flags | other.cloud().flags) & np.uint16(SUSPECT)) != 0
            sure = (of_lines(one) - of_lines(other))[~doubtful]
        off += [np.nanmean(sure)] if len(sure) else []
    # Lines err as a whole, by what is common to their echoes, and so do small scans: by what they differ.
    assert len(off) >= 4
    sd_of_mean_mm = np.std(off, ddof=1) / np.sqrt(len(off))
    assert np.mean(off) == pytest.approx(bone["range_error"]["bias_mm"], abs=4 * sd_of_mean_mm)


def test_a_material_that_was_never_measured_is_scanned_with_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small = ["scan", "--grid", "2x3", "-o", str(tmp_path / "fat.db"), "--json"]
    assert command([*small, "--material", "fat"]) == 0
    seen = capsys.readouterr()
    assert json.loads(seen.out)["range_error"]["sd_mm"] is None
    assert "picoradar bench penetration --material fat" in seen.err


def test_the_budget_of_a_recording_reaches_targets_and_verdict(call: Callable[..., Called], tmp_path: Path) -> None:
    demo = tmp_path / "demo"
    code, found = call("demo", "--grid", "20x20", "--step-mm", "2", "--mode", "window", "--out", demo)
    assert (code, found["registration"]["verdict"]) == (0, "pass")
    given = ("register", demo / "scan.db", demo / "model.stl", "--landmarks", demo / "landmarks.json")
    _, own = call(*given)
    sd_mm = found["scan"]["range_error"]["sd_mm"]
    assert own["targets"][0]["bias_mm"] == pytest.approx(sd_mm, rel=0.15)  # seen from one side: all of it
    _, stated = call(*given, "--range-bias-mm", 0.45)
    assert stated["targets"][0]["bias_mm"] == pytest.approx(0.45, rel=0.15)  # so is this, less what the points show
    assert stated["targets"][0]["bias_mm"] <= 0.45 / sd_mm * own["targets"][0]["bias_mm"] * (1 + 1e-9)
    for target in (*own["targets"], *stated["targets"]):
        assert target["stated_mm"] == pytest.approx(target["p95_mm"] + 2 * target["bias_mm"])
    assert stated["verdict"] == "caution"
    assert "common range error" in stated["reasons"][0]

    call("export", demo / "scan.db", "-o", tmp_path / "cloud.csv")
    code, exported = call("register", tmp_path / "cloud.csv", demo / "model.stl", *given[3:])
    assert (code, exported["verdict"]) == (0, "pass")
    assert exported["targets"][0]["bias_mm"] == pytest.approx(sd_mm, rel=0.15)

    table = (tmp_path / "cloud.csv").read_text().splitlines()  # that of another program says nothing of it
    (tmp_path / "other.csv").write_text("\n".join(row for row in table if not row.startswith("#")))
    code, unknown = call("register", tmp_path / "other.csv", demo / "model.stl", *given[3:])
    assert (code, unknown["verdict"]) == (0, "caution")
    assert "bench penetration" in " ".join(unknown["reasons"])
    assert unknown["targets"][0]["bias_mm"] is None


def test_bench_penetration_from_the_command_line(call: Callable[..., Called], tmp_path: Path) -> None:
    code, found = call(
        "bench", "penetration", "--material", "cartilage", "--coat-mm", "0.2", "--out", tmp_path / "report"
    )
    assert (code, found["figures"]["material"], found["figures"]["coat_mm"]) == (0, "cartilage", 0.2)
    made = Calibration.load(tmp_path / "report" / "calibration.json")
    assert set(made.materials) == {"bone", "cartilage"}
    assert abs(made.materials["cartilage"]["half-maximum"].bias_mm) < 0.2
    code, shown = call("calibration", "show", tmp_path / "report" / "calibration.json")
    assert shown["materials"]["cartilage"]["window"]["method"].startswith("bench procedure penetration")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("penetration", "--material", "paint"), "sample_material"),
        (("penetration", "--material", "granite"), "sample_material"),
        (("gray-target", "--material", "bone"), "penetration"),
        (("scanner", "--coat-mm", "0.1"), "penetration"),
    ],
)
def test_what_makes_no_sense_is_refused(
    call: Callable[..., Called], tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    code, found = call("bench", *arguments, "--out", tmp_path / "report")
    assert code == 2
    assert said in found["error"]
