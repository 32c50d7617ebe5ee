"""What is asked ahead of its answer, to look after a line under light, never mixes with what is asked next."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.dg645 import DG645, TriggerSource
from picoradar.drivers.genesys import Genesys
from picoradar.drivers.links import SerialLink

SAID = {b"TSRC?": b"0", b"TRAT?": b"80000", b"LERR?": b"0", b"*IDN?": b"Stanford Research Systems,DG645,s/n1,ver1"}


class Slow:
    """A DG645 behind a computer or converter that is late with everything."""

    baud = 9600
    late_s = 0.3

    def __init__(self) -> None:
        self._send: Callable[[bytes, float], None] = lambda data, delay_s: None

    def connect(self, send: Callable[[bytes, float], None]) -> None:
        self._send = send

    def receive(self, data: bytes) -> None:
        for line in data.split(b"\n"):
            if line:
                self._send(SAID[line] + b"\r\n", self.late_s)


def test_an_unsolicited_message_is_not_the_answer_that_is_waited_through(scripted: Callable[..., SerialLink]) -> None:
    supply = Genesys(scripted([(b"OUT?\r", b"!06\rON\r"), (b"OUT 0\r", b"OK\r"), (b"OUT?\r", b"OFF\r")]))
    assert supply.output_answers() is None
    supply.switch(on=False)
    assert supply.unsolicited == 1


@pytest.mark.parametrize("looks", [2, 3])
def test_a_late_answer_is_not_taken_for_that_of_the_next_query(
    looks: int, clock: VirtualClock, connect: Callable[..., SerialLink]
) -> None:
    link = connect(Slow())
    link.open()
    generator = DG645(link)
    answers = []
    for _ in range(looks):
        answers.append(generator.triggers_answer())
        clock.sleep(0.25 if len(answers) < looks else 0.0)
    assert answers[:2] == [None, True]  # asked for once more, and the first answer read; the second is to come
    assert generator.trigger_rate_hz == 80_000
    assert generator.trigger_source is TriggerSource.INTERNAL


def test_a_question_that_is_broken_off_leaves_no_answer_behind(
    clock: VirtualClock, connect: Callable[..., SerialLink], monkeypatch: pytest.MonkeyPatch
) -> None:
    firmware = Slow()
    firmware.late_s = 0.05
    link = connect(firmware)
    link.open()
    generator, write = DG645(link), link.write

    def interrupted(data: bytes) -> Any:
        write(data)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(link, "write", interrupted)
        with pytest.raises(KeyboardInterrupt):
            generator.triggers_answer()
    assert generator.trigger_rate_hz == 80_000
