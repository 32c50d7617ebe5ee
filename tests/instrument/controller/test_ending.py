"""The end of a scan by its script: each part once, what is broken off taken up again, an emergency off obeyed."""

from __future__ import annotations

from typing import Any

import pytest

from picoradar.drivers.errors import DeviceFault
from picoradar.instrument.errors import InterlockTripped

PARTS = ("sampler.gate_off", "pulser.off", "sampler.stop", "galvo.park", "diode.off", "finish")


def parts_after(script: Any, what: str) -> list[str]:
    """The parts of the end that were asked for after the last call of a name."""
    asked = script.asked()
    last = len(asked) - 1 - asked[::-1].index(what)
    return [part for part in asked[last + 1 :] if part in PARTS]


def test_every_part_of_the_end_is_taken_once(script: Any) -> None:
    script.run().run()
    assert parts_after(script, "append") == ["sampler.gate_off", "pulser.off", "sampler.stop", "galvo.park", "finish"]


def test_an_interlock_that_switches_everything_off_does_so_once(script: Any) -> None:
    script.fails("line 1", InterlockTripped("lid", "open", action="off"))
    with pytest.raises(InterlockTripped, match="lid"):
        script.run().run()
    everything = ["sampler.gate_off", "pulser.off", "sampler.stop", "galvo.park", "diode.off", "finish"]
    assert parts_after(script, "line 1") == everything


def test_an_emergency_off_during_the_end_switches_the_diode_off_as_well(script: Any) -> None:
    script.acts["galvo.park"] = [lambda: script.requests.put("emergency off")]
    with pytest.raises(InterlockTripped, match="emergency off"):
        script.run().run()
    assert parts_after(script, "append")[4:] == [
        "sampler.gate_off",
        "pulser.off",
        "sampler.stop",
        "galvo.park",
        "diode.off",
        "finish",
    ]
    assert script.machine.state == "fault"
    ((reason, verified, _),) = script.told("finish")
    assert "emergency off" in reason
    assert verified is True


@pytest.mark.parametrize("broken_off", PARTS[:4])
@pytest.mark.parametrize("times", [1, 2])
def test_a_part_that_is_broken_off_is_taken_again(script: Any, broken_off: str, times: int) -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    script.acts["line 2"] = [lambda: script.acts[broken_off].extend([interrupt] * times)]
    with pytest.raises(KeyboardInterrupt):
        script.run().run()
    assert parts_after(script, "append").count(broken_off) == times + 1
    assert script.machine.state == "fault"
    ((_, verified, _),) = script.told("finish")
    assert verified is True


def test_the_end_of_a_sound_scan_that_cannot_be_recorded_is_a_failure(script: Any) -> None:
    script.always["finish"] = _raising(OSError(28, "No space left on device"))
    with pytest.raises(OSError, match="No space left"):
        script.run().run()
    assert script.machine.state == "fault"
    assert parts_after(script, "append")[:4] == list(PARTS[:4])


def test_after_a_failure_it_is_the_failure_that_is_raised(script: Any) -> None:
    script.always["finish"] = _raising(OSError(28, "No space left on device"))
    script.fails("line 1", DeviceFault("bridge", "refused"))
    with pytest.raises(DeviceFault, match="refused"):
        script.run().run()
    assert [event for event, _ in script.told("error")] == ["the end of the scan could not be recorded"]


def _raising(error: Exception) -> Any:
    def act() -> None:
        raise error

    return act
