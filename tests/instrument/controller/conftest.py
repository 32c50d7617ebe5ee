"""A scripted bench: each call is written down with its time, can be made to fail, and can take time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.interfaces import Identity, PulserStatus, SamplerStatus, TemperatureStatus
from picoradar.instrument.bench import Bench
from picoradar.instrument.controller import disk
from picoradar.instrument.controller.context import RunContext
from picoradar.instrument.controller.exposure import exposure_of
from picoradar.instrument.controller.interlocks import interlocks
from picoradar.instrument.controller.machine import StateMachine
from picoradar.instrument.controller.requests import Requests
from picoradar.instrument.controller.run import ScanRun
from picoradar.instrument.controller.safety import SafeShutdown
from picoradar.instrument.controller.supervision import Supervisor
from picoradar.instrument.line import Flag, ScanLine
from picoradar.instrument.settings import Settings

PLACE_S = 0.125
Act = Callable[[], None]


class Device:
    """Any device: what it is asked goes to the script, by its name and the verb."""

    def __init__(self, script: Script, name: str) -> None:
        self.link = SimpleNamespace(device=name)
        self._script, self._name = script, name

    def __getattr__(self, verb: str) -> Any:
        def call(*_: Any, **__: Any) -> Any:
            return self._script.call(f"{self._name}.{verb}")

        return call


class Script:
    """The bench with all that is around a run.

    ``calls`` are the (time, what) of each call. ``acts[what]`` holds what to do at each of the next calls of that
    name, in their order (None: nothing); ``always[what]`` is done at every call.
    """

    def __init__(self, folder: Path) -> None:
        self.calls: list[tuple[float, str]] = []
        self.acts: dict[str, list[Act | None]] = defaultdict(list)
        self.always: dict[str, Act] = {}
        self.clock = VirtualClock()
        self.gate, self.interlock_closed, self.triggers_on, self.degc = "off", True, False, 23.0
        self.regulating, self.names = True, {"galvo": "Galvo A"}
        self.reference: tuple[float, float | None] = (45.0, 7400.0)
        self.answers: dict[str, Any] = {}  # of calls that the cases in `call` do not know
        self.memory: dict[str, Any] = {}
        self.run_ups: dict[int, list[int]] = {}
        self.recorded: dict[int, dict[str, Any]] = {}
        self.rows, self.line_bytes, self.path = [0, 1, 2], 1000, folder / "scan.db"
        self.seen: list[tuple[str, Any]] = []  # what store, log and machine were told
        names = ("sampler", "pulser", "diode", "galvo")
        self.bench = Bench(self.clock, **{n: Device(self, n) for n in names[1:]}, sampler=Device(self, "sampler"))  # type: ignore[arg-type]
        self.settings = Settings()
        self.machine = StateMachine(lambda _old, new, verb: self.seen.append(("state", (verb, new))))
        for verb in ("connect", "warm_up", "warmed"):
            self.machine.go(verb)
        self.supervisor = Supervisor(self.bench, interlocks(self.settings, exposure_of(self.settings.pulser)))
        self.requests = Requests()

    def call(self, what: str) -> Any:
        self.calls.append((self.clock.now(), what))
        if act := (self.acts[what].pop(0) if self.acts[what] else self.always.get(what)):
            act()
        match what:
            case "sampler.gate_on":
                self.gate = "on"
            case "sampler.gate_off":
                self.gate = "off"
            case "sampler.clear_lockout":
                self.gate = "off"
            case "pulser.on":
                self.triggers_on = True
            case "pulser.off":
                self.triggers_on = False
            case "diode.off":
                self.regulating = False
            case "diode.regulate":
                self.regulating = True
            case "sampler.status":
                rate = 80_000.0 if self.triggers_on else 0.0
                return SamplerStatus("idle", self.gate, self.interlock_closed, self.triggers_on, rate, 0.9)
            case "pulser.status":
                volts = 290.0 if self.triggers_on else 0.0
                return PulserStatus(self.triggers_on, self.triggers_on, True, 80_000.0, 290.0, volts, 0.0124)
            case "diode.status":
                return TemperatureStatus(self.degc, 23.0, self.regulating, stable=True)
            case "galvo.ready":
                return True
            case _ if what.endswith(".identify"):
                return Identity(self.names.get(what.split(".")[0], ""))
        return self.answers.get(what)

    def fails(self, what: str, *errors: BaseException | None) -> None:
        """Let the next calls of a name fail, one after the other."""
        self.acts[what] += [raising(error) if error else None for error in errors]

    def asked(self, *verbs: str) -> list[str]:
        """Get the calls so far in their order; only of some names, if given."""
        return [what for _, what in self.calls if not verbs or what in verbs]

    def times(self, what: str) -> list[float]:
        return [time for time, name in self.calls if name == what]

    def told(self, kind: str) -> list[Any]:
        """Get what store, log or machine were told."""
        return [what for name, what in self.seen if name == kind]

    def kinds(self) -> list[tuple[str, str | None]]:
        """Get kind and state of each event that the store was told."""
        return [(kind, state) for _, kind, state, _ in self.told("event")]

    # ---- job, store and log

    def configure(self, _sampler: Any) -> None:
        self.call("job.configure")

    def state_dict(self) -> dict[str, Any]:
        return self.memory

    def goes_on_at(self, row: int) -> bool:
        return row in self.run_ups

    def run_up(self, row: int) -> list[int]:
        return self.run_ups[row]

    def recall(self, row: int) -> dict[str, Any]:
        self.call(f"recall {row}")
        return self.recorded.get(row, {})

    def take_line(self, row: int, galvo: Any, sampler: Any, between: Act) -> ScanLine:
        assert (galvo, sampler) == (self.bench.galvo, self.bench.sampler)
        for _ in range(4):
            between()
            self.clock.sleep(PLACE_S)
        self.call(f"line {row}")
        none = np.zeros(4)
        flags = np.array([0, Flag.NO_ECHO, Flag.MIXED, Flag.MIXED], dtype=np.uint16)
        return ScanLine(
            row, np.arange(4, dtype=np.int32), none, none, none, none, none, none, flags, None, 1, self.clock.now()
        )

    def append(self, line: ScanLine, *, acknowledged_at_s: float | None = None) -> None:
        self.call("append")
        self.seen.append(("line", (line.index, acknowledged_at_s)))

    def event(self, time_s: float, kind: str, *, state: str | None = None, **fields: object) -> None:
        self.call(f"event {kind}")
        self.seen.append(("event", (time_s, kind, state, fields)))

    def finish(self, stop_reason: str, *, laser_off_verified: bool, **summary: object) -> bool:
        self.call("finish")
        self.seen.append(("finish", (stop_reason, laser_off_verified, summary)))
        return True

    def run(self, *sinks: Callable[[ScanLine], None]) -> ScanRun:
        known = {n: Identity(self.names.get(n, "")) for n in self.bench.devices()}
        log: Any = SimpleNamespace(
            **{
                level: (lambda event, level=level, **fields: self.seen.append((level, (event, fields))))
                for level in ("info", "warning", "error", "critical")
            }
        )
        context = RunContext(
            self.bench,
            self.settings,
            self.machine,
            self.supervisor,
            self.requests,
            known,
            SafeShutdown(self.bench),
            log,
        )
        return ScanRun(context, self, self, list(sinks))


def raising(error: BaseException) -> Act:
    def act() -> None:
        raise error

    return act


@pytest.fixture(autouse=True)
def free_bytes(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """Room on the disk; a line takes 1000."""
    free = {"free": 1e6}
    monkeypatch.setattr(disk.shutil, "disk_usage", lambda _path: SimpleNamespace(**free))
    return free


@pytest.fixture
def script(tmp_path: Path) -> Script:
    return Script(tmp_path)
