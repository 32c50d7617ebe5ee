"""A whole radar on the simulated bench, small enough to be scanned in a moment."""

from __future__ import annotations

import io
import json
import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from picoradar.drivers.bridge.sbp import Gate
from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.traces import CodeScale
from picoradar.instrument import events
from picoradar.instrument.acquisition import Acquisition, Setup, raster_scan
from picoradar.instrument.bench import make_bench
from picoradar.instrument.cli.main import run
from picoradar.instrument.cli.session import calibration_of
from picoradar.instrument.controller import Controller, ScanOutcome
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Links, Settings, override
from picoradar.sim import SimulatedBench

Told = Callable[..., dict[str, Any]]
"""Runs a command, whose exit status must be `code` (0), and returns its JSON."""


@dataclass
class Radar:
    """A simulated bench and the controller that runs it."""

    settings: Settings
    folder: Path
    clock: VirtualClock = field(default_factory=VirtualClock)
    scans: int = 0

    def __post_init__(self) -> None:
        self.sim = SimulatedBench({"target": "hip"}, seed=self.settings.seed, clock=self.clock)
        self.bench = make_bench(Links(**self.sim.urls), self.clock, self.sim.usb_backend)
        self.controller = Controller(self.bench, self.settings)

    @property
    def lit(self) -> bool:
        """Get whether triggers reach a pulser that has voltage, by the bench itself."""
        open_gate = self.sim.bridge.gate.state is Gate.ON
        return open_gate and self.sim.trigger.rate_hz > 0 and self.sim.genesys.output_v() > 200.0

    def job(self) -> Acquisition:
        return raster_scan(Setup(self.settings, calibration_of(self.settings), self.clock))

    def recording(self) -> Recording:
        job = self.job()
        sampler = self.bench.sampler
        header = job.header({}, seed=1, scale=CodeScale(sampler.zero_code, sampler.mv_per_code))
        self.scans += 1
        return Recording.create(self.folder / f"scan{self.scans}.db", header)

    def get_ready(self) -> None:
        self.controller.connect()
        self.controller.warm_up()

    def scan(self, *sinks: Callable[[ScanLine], None], store: Any = None) -> ScanOutcome:
        """Scan into a recording (the last is ``scan<n>.db`` in the folder), or into another store."""
        if store is not None:
            return self.controller.scan(self.job(), store, sinks)
        with self.recording() as recording:
            return self.controller.scan(self.job(), recording, sinks)

    def last_recording(self) -> Recording:
        return Recording.open(self.folder / f"scan{self.scans}.db")


SMALL = {"scan": {"rows": 4, "columns": 3}, "diode": {"warm_up_limit_s": 120.0}}


@pytest.fixture(autouse=True)
def _quiet() -> None:
    events.configure(logging.CRITICAL, io.StringIO())


@pytest.fixture
def make_radar(tmp_path: Path) -> Iterator[Callable[..., Radar]]:
    made: list[Radar] = []

    def make(changes: dict[str, Any] | None = None) -> Radar:
        settings = override(override(Settings(), SMALL), changes or {})
        folder = tmp_path / f"radar{len(made)}" if made else tmp_path
        folder.mkdir(exist_ok=True)
        made.append(Radar(settings, folder))
        return made[-1]

    yield make
    for one in made:
        one.sim.close()


@pytest.fixture
def radar(make_radar: Callable[..., Radar]) -> Radar:
    """Give a radar that is warm and ready to scan."""
    one = make_radar()
    one.get_ready()
    return one


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str]) -> Told:
    """Run a command and get its JSON; the exit status must be the one that is expected."""

    def call(*arguments: object, code: int = 0) -> dict[str, Any]:
        capsys.readouterr()
        assert run([*map(str, arguments), "--json"]) == code, capsys.readouterr().err
        result: dict[str, Any] = json.loads(capsys.readouterr().out)
        return result

    return call
