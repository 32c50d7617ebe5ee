"""Bench procedures with a person at the bench: questions, slips, Ctrl-C; and the transmitter over a served bench."""

from __future__ import annotations

import json
import os
import queue
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from picoradar.instrument.cli.light_meters import light_meters
from picoradar.instrument.cli.person import Person
from picoradar.instrument.cli.session import Session, session
from picoradar.instrument.cli.stages import PersonStage, SimulatedStage
from picoradar.instrument.errors import BadInput, Interrupted
from picoradar.instrument.procedures import distance, drift, transmitter
from picoradar.instrument.procedures.geometry import Pose
from picoradar.instrument.procedures.geometry import procedure as geometry
from picoradar.instrument.procedures.gray_target import procedure as gray_target
from picoradar.instrument.procedures.gray_target import templates
from picoradar.instrument.procedures.penetration import procedure as penetration
from picoradar.instrument.procedures.prism import procedure as prism
from picoradar.instrument.procedures.scanner import procedure as scanner
from picoradar.instrument.procedures.station import Outcome, Placing, Radar, Station
from picoradar.instrument.settings import Settings, load_settings, override
from picoradar.sim.physics import Transmitter
from picoradar.sim.settings import SimulationSettings

SMALL: dict[str, tuple[int, Callable[[Station], Outcome]]] = {
    "gray-target": (7, lambda s: gray_target.run(s, levels=4, readings=20)),
    "templates": (5, lambda s: templates.run(s, levels=3, readings=20)),
    "geometry": (2, lambda s: geometry.run(s, poses=(Pose(800.0),), points_a_side=6)),
    "prism": (1, lambda s: prism.run(s, thin=12)),
    "distance": (27, lambda s: distance.run(s, readings=6, short=3)),
    "drift": (2, lambda s: drift.run(s, hours=0.05, interval_s=18.0, readings=2)),
    "scanner": (6, lambda s: scanner.run(s, steps=4)),
    "penetration": (1, lambda s: penetration.run(s, tilts_deg=(0.0,), step_mm=2.0)),
}
"""Questions that a small run asks, and the run."""
SETTINGS_OF_SIM = SimulationSettings()


class Script:
    """Answers, handed out one by one as they come in."""

    def __init__(self, *answers: str) -> None:
        self._answers: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self.say(*answers)

    def say(self, *answers: str | None) -> None:
        for answer in answers:
            self._answers.put(answer)

    def __iter__(self) -> Iterator[str]:
        while (answer := self._answers.get()) is not None:
            yield answer + "\n"


class Hands(PersonStage):
    """A person who does what is asked on the simulated bench, and says so."""

    def __init__(self, person: Person, script: Script, stage: SimulatedStage) -> None:
        super().__init__(person)
        self._script, self._stage = script, stage

    def place(self, wanted: Placing) -> float:
        self._stage.place(wanted)
        self._script.say("")
        return super().place(wanted)

    def read_scale(self) -> tuple[float, float]:
        x_mm, y_mm = self._stage.read_scale()
        self._script.say(f"{x_mm:.2f}, {y_mm:.2f}")
        return super().read_scale()


@pytest.fixture(scope="module")
def bench() -> Iterator[Session]:
    with session(override(Settings(), {"simulation": {"target": "plate"}}), None) as run:
        run.controller.warm_up()
        yield run


def station_of(run: Session, stage: PersonStage, folder: Path) -> Station:
    radar = Radar(run.controller, run.settings, run.calibration, run.identities)
    return Station(radar, stage, folder, lambda _share, _note: None)


@pytest.mark.parametrize("name", SMALL)
def test_a_person_is_asked_for_each_target_or_reading(
    bench: Session, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    assert bench.simulated is not None
    script = Script()
    stage = Hands(Person(bench.controller.rest, script), script, SimulatedStage(bench.simulated))  # type: ignore[arg-type]
    questions, run = SMALL[name]
    outcome = run(station_of(bench, stage, tmp_path))
    lines = capsys.readouterr().err.splitlines()
    asked = [line for line in lines if "q: stop" in line or "Position of the spot" in line]
    assert "no range" not in outcome.findings[0]
    assert len(asked) == questions + (1 if name == "scanner" else 0), asked
    script.say(None)


def test_settling_is_left_out_where_a_person_reads_the_scale(bench: Session, tmp_path: Path) -> None:
    assert bench.simulated is not None
    script = Script()
    stage = Hands(Person(bench.controller.rest, script), script, SimulatedStage(bench.simulated))  # type: ignore[arg-type]
    outcome = SMALL["scanner"][1](station_of(bench, stage, tmp_path))
    script.say(None)
    assert outcome.figures["settle_ms"] is None
    assert any("needs a camera" in finding for finding in outcome.findings)


def by_hand(*answers: str) -> PersonStage:
    return PersonStage(Person(wait_for, iter([a + "\n" for a in answers])))  # type: ignore[arg-type]


def wait_for(until: Callable[[], bool]) -> None:
    while not until():
        pass


def test_slips_are_asked_again(capsys: pytest.CaptureFixture[str]) -> None:
    stage = by_hand("abc", "9100", "nan", "1,2", " 912.5 ", "", "3", "1.5,x", "600,0", "-4, 0.5")
    assert stage.place(Placing("plate", 910.0)) == 912.5
    assert stage.place(Placing("plate", 910.0)) == 910.0
    assert stage.read_scale() == (-4.0, 0.5)
    told = capsys.readouterr().err
    assert told.count("cannot be used") == 7
    assert "'9100' cannot be used: give a number from 810 to 1010; or q to stop" in told


def test_a_person_can_stop_and_an_empty_chair_is_noticed() -> None:
    with pytest.raises(Interrupted, match="stopped by the person"):
        by_hand("q").place(Placing("plate", 910.0))
    stage = by_hand()
    for _ in range(2):
        with pytest.raises(BadInput, match="no answer"):
            stage.place(Placing("plate", 910.0))


def test_ctrl_c_is_obeyed_while_a_question_is_open(bench: Session) -> None:
    script = Script()
    stage = PersonStage(Person(bench.controller.rest, script))  # type: ignore[arg-type]
    timer = threading.Timer(0.3, lambda: bench.controller.request("interrupt"))
    timer.start()
    with pytest.raises(Interrupted):
        stage.place(Placing("plate", 910.0))
    assert bench.controller.safe.laser_off_verified
    assert bench.controller.state == "ready"
    script.say(None)


# ---- over a served bench


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Settings]:
    """Give the settings that reach a simulated bench in another process."""
    command = [
        sys.executable,
        "-m",
        "picoradar.instrument.cli",
        "sim",
        "--speed",
        "50",
        "--json",
        "--out",
        str(tmp_path / "sim"),
    ]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        yield load_settings(Path(json.loads(process.stdout.readline())["settings"]))
        process.terminate()


class PowerMeterReader:
    """A person who reads a power meter that shows what the simulated laser gives."""

    def __init__(self) -> None:
        self.script = Script()
        self.questions: list[str] = []

    def write(self, text: str) -> int:
        if (found := re.search(r"(\d+) V, (\d+) degC, (\d+) kHz", text)) and text not in self.questions:
            drive_v, degc, rate_hz = float(found[1]), float(found[2]), 1e3 * float(found[3])
            pulse = Transmitter(SETTINGS_OF_SIM).pulse(drive_v, degc, rate_hz)
            power_mw = pulse.energy_pj * 1e-9 * rate_hz * SETTINGS_OF_SIM.exit_transmission
            self.questions.append(text)
            self.script.say("dazzled", f"{power_mw:.4f}")
        return len(text)

    def flush(self) -> None:
        pass


def test_the_laser_is_looked_at_through_the_drivers_of_a_served_bench(
    served: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader = PowerMeterReader()
    monkeypatch.setattr(sys, "stderr", reader)
    with session(served, None) as run:
        assert run.simulated is None
        run.controller.warm_up()
        person = Person(run.controller.rest, reader.script)  # type: ignore[arg-type]
        radar, meters = Radar(run.controller, run.settings, run.calibration, run.identities), light_meters(run, person)
        station = Station(radar, PersonStage(person), tmp_path, lambda _share, _note: None, meters=meters)
        outcome = transmitter.run(station, volts=(270.0, 290.0), degc=(23.0,))
        reader.script.say(None)
    assert outcome.passed, outcome.findings
    assert len(reader.questions) == 3
    assert outcome.figures["working_drive_v"] == 290.0
    assert float(outcome.figures["fwhm_ps"] or 0) == pytest.approx(44, abs=1.5)
    assert float(outcome.figures["peak_power_w"] or 0) == pytest.approx(128, rel=0.05)
    assert run.controller.safe.laser_off_verified


def test_an_oscilloscope_that_takes_the_echoes_cannot_look_at_the_laser(bench: Session) -> None:
    settings = override(bench.settings, {"links": {"sampler": "oscilloscope"}})
    run = Session(settings, bench.controller, bench.identities, bench.calibration, None)
    with pytest.raises(BadInput, match=r'links\.sampler = "bridge"'):
        light_meters(run, Person(bench.controller.rest, Script()))  # type: ignore[arg-type]


def test_without_a_stdin_no_answer_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", None)
    with pytest.raises(BadInput, match="needs a person at the terminal"):
        Person(wait_for).ask("Is the lid closed?")
