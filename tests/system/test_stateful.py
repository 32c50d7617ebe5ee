"""Whatever is asked of the controller, in whatever order, with whatever goes wrong: what must hold always."""

from __future__ import annotations

import io
import logging
import tempfile
from pathlib import Path

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from benchmarks.faults.watch import LightMeter
from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.errors import DeviceError
from picoradar.drivers.traces import CodeScale
from picoradar.instrument import events
from picoradar.instrument.acquisition import Setup, raster_scan
from picoradar.instrument.bench import make_bench
from picoradar.instrument.cli.session import calibration_of
from picoradar.instrument.controller import STATES, Controller, allowed_verbs
from picoradar.instrument.errors import InterlockTripped, Interrupted, NotAllowed
from picoradar.instrument.line import ScanLine
from picoradar.instrument.recording import Recording
from picoradar.instrument.settings import Links, Settings, override
from picoradar.sim import SimulatedBench
from picoradar.sim.faults import KINDS, Fault, arm

SMALL = override(
    Settings(),
    {"scan": {"rows": 3, "columns": 2, "averages": 2}, "diode": {"warm_up_limit_s": 120.0, "settle_limit_s": 10.0}},
)
FAILURES = (DeviceError, InterlockTripped, Interrupted)
KIND_AND_LINK = [(name, link) for name, kind in sorted(KINDS.items()) for link in kind.links]
REQUESTS = ("finish", "pause", "resume", "abort", "interrupt", "emergency off")


class Radar(RuleBasedStateMachine):
    """Verbs, requests and faults at random; the light is watched from outside all the time."""

    @initialize(seed=st.integers(0, 1000))
    def bench_on(self, seed: int) -> None:
        events.configure(logging.CRITICAL, io.StringIO())
        self.folder = tempfile.TemporaryDirectory()
        self.clock = VirtualClock()
        self.sim = SimulatedBench({"target": "plate", "ambient_degc": 22.5}, seed=seed, clock=self.clock)
        bench = make_bench(Links(**self.sim.urls), self.clock, self.sim.usb_backend)
        self.controller = Controller(bench, SMALL)
        self.meter = LightMeter(self.sim)
        self.open_outside: set[str] = set()
        self.clock.every(0.005, self._watch)
        self.scans = 0
        self.refusals: list[tuple[str, list[str]]] = []

    def _watch(self) -> None:
        # In ``fault`` the gate may still be open for the moment in which the way out begins.
        if self.sim.bridge.gate_open and self.controller.state not in ("scanning", "fault"):
            self.open_outside.add(self.controller.state)

    def _attempt(self, verb: str, *arguments: object) -> None:
        before, allowed = self.controller.state, allowed_verbs(self.controller.state)
        called = {"warm_up": "warm_up", "scan": "start_scan"}.get(verb, verb)
        try:
            getattr(self.controller, verb)(*arguments)
        except NotAllowed as refused:
            assert called not in allowed
            self.refusals.append((str(refused), allowed))
            assert self.controller.state == before
        except FAILURES:
            assert called in allowed
        else:
            assert called in allowed

    @rule()
    def connect(self) -> None:
        self._attempt("connect")

    @rule()
    def warm_up(self) -> None:
        self._attempt("warm_up")

    @rule()
    def acknowledge(self) -> None:
        self._attempt("acknowledge")

    @rule()
    def shut_down(self) -> None:
        self._attempt("shut_down")

    @rule()
    def emergency_off(self) -> None:
        self.controller.emergency_off()
        assert self.controller.state == "fault"

    @rule(what=st.sampled_from(REQUESTS), after_s=st.floats(0, 8))
    def ask(self, what: str, after_s: float) -> None:
        self.clock.call_at(self.clock.now() + after_s, lambda: self.controller.request(what))

    @rule(
        chosen=st.sampled_from(KIND_AND_LINK),
        after_s=st.floats(0, 8),
        lasts_s=st.one_of(st.none(), st.floats(0.1, 30)),
    )
    def something_goes_wrong(self, chosen: tuple[str, str], after_s: float, lasts_s: float | None) -> None:
        kind, link = chosen
        at = {"time_s": self.clock.now() + after_s}
        arm(self.sim, [Fault.model_validate({"kind": kind, "link": link, "at": at, "lasts_s": lasts_s})])

    @precondition(lambda self: self.controller.state == "ready")
    @rule()
    def scan(self) -> None:
        self.scans += 1
        path = Path(self.folder.name) / f"{self.scans}.db"
        self.clock.call_at(self.clock.now() + 100.0, lambda: self.controller.request("abort"))  # no pause for ever
        job = raster_scan(Setup(SMALL, calibration_of(SMALL), self.clock))
        header = job.header({}, seed=0, scale=CodeScale(32.0, 0.5))
        seen: list[int] = []

        def sink(line: ScanLine) -> None:
            seen.append(line.index)

        with Recording.create(path, header) as recording:
            self._attempt("scan", job, recording, [sink])
        with Recording.open(path) as recording:
            assert all(line.ok for line in recording.check())
            assert set(seen) <= set(recording.done)
            assert recording.stop_reason

    @invariant()
    def what_must_hold(self) -> None:
        if not hasattr(self, "controller"):
            return
        controller = self.controller
        assert controller.state in STATES
        assert not self.meter.is_lit(), f"light in state {controller.state}"
        assert not self.open_outside
        assert all(word in words for words, allowed in self.refusals for word in allowed)
        assert bool(controller.cause) is (controller.state == "fault")
        assert (controller.state == "fault") <= bool(controller.why())

    def teardown(self) -> None:
        if hasattr(self, "sim"):
            self.sim.close()
            self.folder.cleanup()


TestRadar = Radar.TestCase
TestRadar.settings = settings(
    max_examples=12, stateful_step_count=14, deadline=None, suppress_health_check=list(HealthCheck)
)
