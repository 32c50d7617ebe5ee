"""The safe way out: every step is tried, whatever the one before has done."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import pytest

from picoradar.drivers.errors import DeviceFault, LinkLost
from picoradar.instrument.controller import make_safe
from picoradar.instrument.controller.safety import VERIFIED


class Steps:
    """A bench whose steps are written down; some of them fail."""

    def __init__(self, failing: dict[str, BaseException]) -> None:
        self.done: list[str] = []

        def step(name: str) -> Any:
            def carry_out() -> None:
                self.done.append(name)
                if name in failing:
                    raise failing[name]

            return carry_out

        self.sampler = SimpleNamespace(gate_off=step("gate"), stop=step("run"))
        self.pulser = SimpleNamespace(off=step("pulser"))
        self.galvo = SimpleNamespace(park=step("mirrors"))
        self.diode = SimpleNamespace(off=step("diode"))


NAMES = ("gate", "pulser", "run", "mirrors", "diode")
FAILURES = (LinkLost("x", "gone"), DeviceFault("x", "refused"), RuntimeError("a defect"), OSError(5, "disk"))


@pytest.mark.parametrize("broken", [c for n in range(6) for c in itertools.combinations(NAMES, n)], ids="-".join)
def test_every_step_is_tried_and_its_outcome_kept(broken: tuple[str, ...]) -> None:
    bench = Steps({name: FAILURES[i % len(FAILURES)] for i, name in enumerate(sorted(broken))})
    safe = make_safe(bench, diode_off=True)  # type: ignore[arg-type]
    assert sorted(bench.done) == sorted(NAMES)
    assert {name for name, outcome in safe.steps.items() if outcome != VERIFIED} == set(broken)
    assert safe.laser_off_verified is (not {"gate", "pulser"} <= set(broken))
    assert safe.complete is (not broken)
    assert ("LASER NOT VERIFIED OFF" in str(safe)) is ({"gate", "pulser"} <= set(broken))


@pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit, GeneratorExit])
def test_what_ends_the_program_waits_until_all_steps_were_tried(kind: type[BaseException]) -> None:
    bench = Steps({"gate": kind()})
    with pytest.raises(kind):
        make_safe(bench)  # type: ignore[arg-type]
    assert bench.done == ["gate", "pulser", "run", "mirrors"]


def test_the_device_that_failed_is_asked_last_because_it_may_not_answer() -> None:
    bench = Steps({})
    make_safe(bench, suspected="sampler")  # type: ignore[arg-type]
    assert bench.done == ["pulser", "mirrors", "gate", "run"]
    bench = Steps({})
    make_safe(bench, suspected="pulser")  # type: ignore[arg-type]
    assert bench.done == ["gate", "run", "mirrors", "pulser"]


def test_the_outcome_is_told_in_the_words_of_the_failures() -> None:
    safe = make_safe(Steps({"gate": LinkLost("bridge", "gone"), "mirrors": RuntimeError()}))  # type: ignore[arg-type]
    assert safe.steps == {"gate": "bridge: gone", "pulser": VERIFIED, "run": VERIFIED, "mirrors": "RuntimeError"}
    assert str(safe) == "laser off verified; gate: bridge: gone; mirrors: RuntimeError"
    assert str(make_safe(Steps({}))) == "laser off verified"  # type: ignore[arg-type]
