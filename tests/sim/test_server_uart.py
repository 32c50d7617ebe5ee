"""What a receiver at another baud rate makes of a byte stream."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from picoradar.sim.server.uart import heard

BAUDS = st.sampled_from([1200, 4800, 9600, 19200, 57600, 115200])


@given(st.binary(max_size=200), BAUDS)
def test_equal_rates_change_nothing(data: bytes, baud: int) -> None:
    assert heard(data, sent_baud=baud, read_baud=baud) == data


@pytest.mark.parametrize("deviation", [-0.04, -0.02, 0.02, 0.04])
def test_rates_within_a_few_percent_are_read_correctly(deviation: float) -> None:
    every_byte = bytes(range(256))
    assert heard(every_byte, sent_baud=9600, read_baud=9600 * (1 + deviation)) == every_byte


def test_a_receiver_twice_as_fast_sees_each_bit_twice() -> None:
    # U with its start bit is 0 1 0 1 ... on the line; at double rate 00 11 00 11 ..., the first 0 being the start bit.
    assert heard(b"U", sent_baud=9600, read_baud=19200)[0] == 0b01100110


@given(st.binary(min_size=4, max_size=50), BAUDS, BAUDS)
def test_any_rate_ends_and_gives_the_same_garbage_each_time(data: bytes, sent: int, read: int) -> None:
    first = heard(data, sent_baud=sent, read_baud=read)
    assert first == heard(data, sent_baud=sent, read_baud=read)
    assert len(first) <= 10 * len(data)


def test_a_line_of_text_at_the_wrong_rate_is_no_text() -> None:
    for wrong in (4800, 19200, 38400, 115200):
        assert b"*IDN?" not in heard(b"*IDN?\n", sent_baud=wrong, read_baud=9600)
