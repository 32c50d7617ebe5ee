"""Genesys: messages, check sums, numbers and registers as text, without a line."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from picoradar.drivers.genesys import Fault, Status, parse_rating
from picoradar.drivers.genesys.wire import checksum, decode, encode, format_number, parse_state, unsolicited_from

GOLDEN = tomllib.loads((Path(__file__).parents[1] / "golden" / "genesys.toml").read_text())
CHECKSUMS = [(text, wire.encode()) for text, wire in GOLDEN["check_sums"]]


@pytest.mark.parametrize(("text", "wire"), CHECKSUMS)
def test_check_sums_of_the_sheet(text, wire):
    assert encode(text, with_checksum=True) == wire
    assert decode(wire, with_checksum=True) == text


def test_check_sum_of_the_digits():
    assert checksum("123456789") == "DD"


def test_bytes_of_the_voltage():
    assert encode("PV 290") == bytes.fromhex("50 56 20 32 39 30 0d")
    assert encode("OK") == bytes.fromhex("4f 4b 0d")


def test_rating_from_the_name():
    assert parse_rating("LAMBDA,GEN600-1.3") == (600, 1.3)
    assert parse_rating("LAMBDA,GEN300-2.5") == (300, 2.5)


def test_replies_are_read_with_and_without_a_check_sum():
    assert decode(b"OK\r") == "OK"
    assert decode(b"OK$9a\r\n") == "OK"


@pytest.mark.parametrize(
    ("line", "with_checksum"),
    [(b"O\x01K\r", False), (b"OK\r", True), (b"OK$9B\r", False), (b"\xffK\r", False), (b"", True)],
)
def test_a_damaged_reply_is_refused(line, with_checksum):
    with pytest.raises(ValueError, match=r"control characters|check sum|ascii"):
        decode(line, with_checksum=with_checksum)


def test_registers_in_a_state_reply_are_hexadecimal():
    state = parse_state("MV(000.00),PV(290),MC(0.0000),PC(0.1),SR(8C),FR(A0)")
    assert state.status == Status.LOCAL | Status.FAULT | Status.NO_FAULT
    assert state.fault == Fault.INTERLOCK | Fault.SHUT_OFF
    with pytest.raises(ValueError, match="no reply to STT"):
        parse_state("MV(000.00),PV(290),MC(0.0000),PC(0.1),SR(8C)")


@pytest.mark.parametrize(("text", "address"), [("!06", 6), ("!30", 30), ("!6", None), ("06", None), ("!06 ", None)])
def test_messages_that_come_unasked_are_known_by_their_form(text, address):
    assert unsolicited_from(text) == address


@pytest.mark.parametrize(
    ("value", "text"),
    [(290.0, "290"), (0.1, "0.1"), (0.0, "0"), (329.175, "329.175"), (1e-6, "0.000001"), (100, "100")],
)
def test_numbers_are_written_in_at_most_twelve_characters(value, text):
    assert format_number(value) == text


def test_a_name_without_a_rating_is_refused():
    with pytest.raises(ValueError, match="contains no rating"):
        parse_rating("LAMBDA,Z+")
