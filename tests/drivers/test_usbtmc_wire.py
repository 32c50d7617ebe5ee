"""Worked bytes of USBTMC and of SCPI waveforms, both ways."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.drivers.links import BadHeader
from picoradar.drivers.links import usbtmc_wire as tmc
from picoradar.drivers.oscilloscope import waveform as scpi
from picoradar.drivers.oscilloscope.record import waveform_record
from picoradar.drivers.oscilloscope.waveform import BadWaveform

_TEXT = (Path(__file__).parents[1] / "golden" / "usbtmc.toml").read_text()
GOLDEN = {name: bytes.fromhex(text) for name, text in tomllib.loads(_TEXT).items()}


def test_messages_are_the_worked_bytes() -> None:
    assert tmc.encode_message(1, b"*IDN?") == GOLDEN["idn"]
    assert tmc.encode_message(1, b"*IDN?\n") == GOLDEN["idn_lf"]
    assert tmc.encode_request(2, 1024) == GOLDEN["request"]
    assert tmc.encode_answer(2, b"ACME,DCA,0,1.0\n", attributes=1) == GOLDEN["answer"]


def test_messages_are_read_from_the_worked_bytes() -> None:
    assert tmc.Header.decode(GOLDEN["idn"]) == tmc.Header(tmc.MsgId.DEV_DEP_MSG_OUT, 1, 5, 1)
    assert tmc.Header.decode(GOLDEN["request"]) == tmc.Header(tmc.MsgId.DEV_DEP_MSG_IN, 2, 1024)
    assert tmc.decode_answer(GOLDEN["answer"], 2) == (b"ACME,DCA,0,1.0\n", True)


def test_capabilities_both_ways() -> None:
    capabilities = tmc.Capabilities.decode(GOLDEN["capabilities"])
    assert capabilities.encode() == GOLDEN["capabilities"]
    assert capabilities.trigger
    assert capabilities.remote_control
    with pytest.raises(BadHeader):
        tmc.Capabilities.decode(GOLDEN["capabilities"][:23])
    with pytest.raises(BadHeader):
        tmc.Capabilities.decode(b"\x80" + GOLDEN["capabilities"][1:])


def test_tags_go_from_1_to_255() -> None:
    tags = [1]
    for _ in range(254):
        tags.append(tmc.next_tag(tags[-1]))
    assert tags == list(range(1, 256))
    assert tmc.next_tag(255) == 1


@given(st.binary(max_size=64), st.integers(1, 255))
@settings(deadline=None, max_examples=100)
def test_answer_survives_the_wire(data: bytes, tag: int) -> None:
    transfer = tmc.encode_answer(tag, data, attributes=0)
    assert len(transfer) % 4 == 0
    assert tmc.decode_answer(transfer, tag) == (data, False)
    with pytest.raises(BadHeader):
        tmc.decode_answer(transfer, tmc.next_tag(tag))


@given(st.binary(max_size=40))
@settings(deadline=None, max_examples=100)
def test_any_bytes_are_an_answer_or_refused(data: bytes) -> None:
    try:
        got, _ = tmc.decode_answer(data, 2)
    except BadHeader:
        return
    assert len(got) == int.from_bytes(data[4:8], "little")


def test_block_both_ways() -> None:
    assert scpi.encode_block(b"\x01\x02\x03\x04") == GOLDEN["block"]
    assert scpi.decode_block(GOLDEN["block"]) == b"\x01\x02\x03\x04"
    assert scpi.encode_block(bytes(2860))[:6] == b"#42860"
    assert scpi.decode_block(b"#9000000002ab\n") == b"ab"
    assert scpi.decode_block(b"#0ab\n") == b"ab"


@pytest.mark.parametrize(
    "message",
    [
        b"",
        b"#",
        b"x14abcd",
        b"#14abc\n",
        b"#14abcde\n",
        b"#14abcd",
        b"#2",
        b"#3 4abcd",
        b"#14abcd\n\n",
        b"-113,error",
        b"#24",
    ],
)
def test_bad_block_is_refused(message: bytes) -> None:
    with pytest.raises(BadWaveform):
        scpi.decode_block(message)


@given(st.binary(max_size=30))
@settings(deadline=None, max_examples=100)
def test_definite_block_has_the_length_that_it_says(message: bytes) -> None:
    try:
        data = scpi.decode_block(b"#2" + message)
    except BadWaveform:
        return
    assert len(data) == int(message[:2])


def test_preamble_of_the_sheet() -> None:
    preamble = scpi.Preamble.decode("2,2,1430,16,6.7E-12,2.0E-09,0,1.5E-06,0.0E+00,0,1,2,3")
    times_s = preamble.times_s()
    assert times_s[[0, 1429]] == pytest.approx([2e-9, 11.5743e-9])
    codes = np.array([1000, scpi.HOLE, scpi.CLIPPED_HIGH, scpi.CLIPPED_LOW, -1000], np.int16)
    volts = preamble.volts(codes)
    assert volts[[0, 4]] == pytest.approx([1.5e-3, -1.5e-3])
    assert np.isnan(volts[1:4]).all()
    assert scpi.Preamble.decode(preamble.encode()) == preamble


@pytest.mark.parametrize(
    "text",
    ["", "1,2,3", "2,2,1430,16,x,2.0E-09,0,1.5E-06,0,0", "2,2,0,16,6.7E-12,0,0,1E-6,0,0", "2,2,9,1,nan,0,0,1,0,0",
     "2,2,9,1,0,0,0,1,0,0", "2,2,9,1,1,0,0,inf,0,0", "2,2,inf,1,1,0,0,1,0,0"],
)  # fmt: skip
def test_bad_preamble_is_refused(text: str) -> None:
    with pytest.raises(BadWaveform):
        scpi.Preamble.decode(text)


def test_record_holds_clipped_samples_and_refuses_holes() -> None:
    preamble = scpi.Preamble(2, 2, 3, 16, 1e-12, 5e-9, 0, 1e-6, 1e-3, 0)
    codes = np.array([-1000, scpi.CLIPPED_HIGH, scpi.CLIPPED_LOW], np.int16)
    record = waveform_record(preamble, codes, run_id=4, number=2, time_us=9)
    assert record.trace_mv == pytest.approx([0.0, 1 + scpi.MAX_CODE * 1e-3, 1 + scpi.MIN_CODE * 1e-3])
    assert record.times_ps == pytest.approx([5000, 5001, 5002])
    assert record.clipped
    with pytest.raises(BadWaveform, match="1 of 3 samples"):
        waveform_record(preamble, np.array([1, scpi.HOLE, 2], np.int16), run_id=4, number=2, time_us=9)


def test_words_have_to_fit_the_preamble() -> None:
    preamble = scpi.Preamble(2, 2, 2, 16, 1e-12, 0, 0, 1e-6, 0, 0)
    assert scpi.decode_words(b"\x01\x00\xff\xff", preamble).tolist() == [1, -1]
    with pytest.raises(BadWaveform, match="3 bytes came for 2 points"):
        scpi.decode_words(b"\x01\x00\xff", preamble)


def test_a_header_of_nothing_more_is_zeros() -> None:
    assert tmc.Header(tmc.MsgId.TRIGGER, 1).encode() == bytes([128, 1, 0xFE]) + bytes(9)


@pytest.mark.parametrize("begin", [(1, 0, 0xFF), (1, 1, 0x00), (1, 1, 1)])
def test_tag_and_complement_have_to_fit(begin: tuple[int, ...]) -> None:
    with pytest.raises(BadHeader, match="contradict each other"):
        tmc.Header.decode(bytes(begin) + bytes(9))


@pytest.mark.parametrize(("length", "padded"), [(0, 0), (1, 4), (4, 4), (5, 8), (12, 12)])
def test_data_are_filled_up_to_four_bytes(length: int, padded: int) -> None:
    assert tmc.padded(b"x" * length) == b"x" * length + bytes(padded - length)


def test_an_answer_has_just_the_bytes_that_its_header_says() -> None:
    whole = tmc.encode_answer(2, b"abcdef", attributes=1)
    assert tmc.decode_answer(whole[:-2], 2) == (b"abcdef", True)  # without the padding
    for wrong in (whole[:-3], whole + b"\0"):
        with pytest.raises(BadHeader, match="header says 6 bytes"):
            tmc.decode_answer(wrong, 2)


@pytest.mark.parametrize(
    ("bits", "trigger", "remote"), [(0, False, False), (1, True, False), (2, False, True), (4, False, False)]
)
def test_capabilities_are_single_bits(bits: int, *, trigger: bool, remote: bool) -> None:
    found = tmc.Capabilities(0, 0, bits, 0)
    assert (found.trigger, found.remote_control) == (trigger, remote)
