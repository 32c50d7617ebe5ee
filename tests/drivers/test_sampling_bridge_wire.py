"""Worked bytes of the sampling bridge protocol, both ways, and the parser of its stream."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.drivers.bridge import sbp
from picoradar.drivers.bridge.sbp import Frame, FrameFlag, FrameParser, encode_frame

_TEXT = (Path(__file__).parents[1] / "golden" / "sampling_bridge.toml").read_text()
GOLDEN = {name: bytes.fromhex(text) for name, text in tomllib.loads(_TEXT).items()}

CONFIGURATION = sbp.Configuration(
    5_000_000, 6_700, 1430, 8, sbp.ConfigFlag.EXTERNAL_TRIGGER, 1, 80_000, sbp.Format.U16, 16
)
SAMPLES = np.array([256, 260, 300, 512], np.uint16)
FRAME = Frame(1, FrameFlag.FIRST | FrameFlag.LAST, 0, 7, 0, 0, 0, 8, 2300, 0xE67B8252, 0, SAMPLES)
WINDOWS = [(sbp.WindowEntry(4_200_000, 6_700, 96, 1), sbp.WindowEntry(9_800_000, 6_700, 96, 1))]

BLOCKS = {
    "info": (sbp.Info, sbp.Info(0x0100, 1, 0x0102, "SB-0001", "SLR sampling bridge", sbp.Feature(0x0F))),
    "caps_1_0": (sbp.Caps, sbp.Caps()),
    "caps_1_1": (sbp.Caps, sbp.Caps(version=0x0101, header_length=52, windows_max=8, entries_max=252)),
    "config": (sbp.Configuration, CONFIGURATION),
    "config_step_refused": (
        sbp.Configuration,
        sbp.Configuration(0, 500, 16, 1, sbp.ConfigFlag.EXTERNAL_TRIGGER, 1, 80_000, sbp.Format.U8, 0),
    ),
    "status": (
        sbp.Status,
        sbp.Status(sbp.State.RUNNING, sbp.Gate.ON, sbp.StatusFlag(0x63), 0, 870, 7, 0, 0, 80_000_000),
    ),
    "event": (sbp.Event, sbp.Event(sbp.EventKind.WATCHDOG, sbp.ErrorCode.WATCHDOG_TRIPPED, 7, 0, 1234)),
}


@pytest.mark.parametrize("name", BLOCKS)
def test_block_is_the_worked_bytes_both_ways(name: str) -> None:
    kind, value = BLOCKS[name]
    assert value.encode() == GOLDEN[name]
    assert kind.decode(GOLDEN[name]) == value


def test_windows_are_the_worked_bytes_both_ways() -> None:
    assert sbp.encode_windows(WINDOWS) == GOLDEN["windows"]
    assert sbp.decode_windows(GOLDEN["windows"]) == WINDOWS


def test_frame_is_the_worked_bytes_both_ways() -> None:
    assert encode_frame(FRAME) == GOLDEN["frame"]
    parser = FrameParser(4096)
    (found,) = parser.feed(GOLDEN["frame"])
    assert found[:-1] == FRAME[:-1]
    assert found.samples.tolist() == [256, 260, 300, 512]
    assert (parser.skipped, parser.bad_headers, parser.bad_payloads, parser.waiting) == (0, 0, 0, 0)


@pytest.mark.parametrize("name", ["info", "caps_1_0", "caps_1_1", "config", "status"])
def test_longer_block_of_a_later_version_is_accepted(name: str) -> None:
    kind, value = BLOCKS[name]
    at = 0 if name in ("config", "status") else 4
    body = bytearray(GOLDEN[name][:-4] + b"more")
    body[at] = len(body) + 4
    assert kind.decode(sbp.seal(bytes(body)) + b"padding of the transfer") == value


@pytest.mark.parametrize("name", [name for name in BLOCKS if name != "event"])  # events carry no check sum
@given(data=st.data())
@settings(deadline=None, max_examples=40)
def test_damaged_block_is_never_taken_for_good(name: str, data: st.DataObject) -> None:
    kind = BLOCKS[name][0]
    raw = bytearray(GOLDEN[name])
    raw[data.draw(st.integers(0, len(raw) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    with pytest.raises(sbp.BadBlock):
        kind.decode(bytes(raw))


def _frames(count: int, header: int) -> list[bytes]:
    return [
        encode_frame(FRAME._replace(sequence=k, window=k % 2, samples=np.full(k % 5 + 1, 40 + k, np.uint16)), header)
        for k in range(count)
    ]


def _plain(frames: list[Frame]) -> list[tuple[object, ...]]:
    return [(*f[:-1], f.samples.tolist()) for f in frames]


@pytest.mark.parametrize("header", [48, 52, 60])
def test_parser_reads_every_header_length(header: int) -> None:
    raw = bytearray(GOLDEN["frame"][:44])
    raw[5] = header
    stream = sbp.seal(bytes(raw) + bytes(header - 48)) + GOLDEN["frame"][48:]
    (found,) = FrameParser(4096).feed(stream)
    assert found.samples.tolist() == [256, 260, 300, 512]


JUNK = st.one_of(st.binary(max_size=20), st.just(b"SLRF"), st.just(b"SLR"), st.just(GOLDEN["frame"][:40]))


@given(
    pieces=st.lists(st.one_of(st.integers(0, 9), JUNK), max_size=12),
    damage=st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 7)), max_size=3),
    cuts=st.lists(st.integers(0, 2000), max_size=30),
    header=st.sampled_from([48, 52]),
)
@settings(deadline=None, max_examples=200)
def test_parser_gives_the_same_for_any_cut_and_never_wrong_frames(
    pieces: list[int | bytes], damage: list[tuple[int, int]], cuts: list[int], header: int
) -> None:
    good = _frames(10, header)
    stream = bytearray(b"".join(good[p] if isinstance(p, int) else p for p in pieces))
    for place, bit in damage:
        if stream:
            stream[place % len(stream)] ^= 1 << bit
    whole = FrameParser(4096)
    expected = _plain(whole.feed(bytes(stream)))
    cut = FrameParser(4096)
    got: list[Frame] = []
    ends = sorted({min(c, len(stream)) for c in cuts} | {len(stream)})
    for begin, end in zip([0, *ends], ends, strict=False):
        got += cut.feed(bytes(stream[begin:end]))
    assert _plain(got) == expected
    assert (cut.skipped, cut.bad_headers, cut.bad_payloads) == (
        whole.skipped,
        whole.bad_headers,
        whole.bad_payloads,
    )
    genuine = _plain([f for raw in good for f in FrameParser(4096).feed(raw)])
    assert all(f in genuine for f in expected)
    used = sum(len(good[f[2]]) for f in expected)  # type: ignore[call-overload]
    assert used + cut.skipped + cut.waiting == len(stream)


def test_undamaged_frames_between_junk_are_all_found() -> None:
    good = _frames(4, 48)
    stream = b"SLRF?" + good[0] + b"SL" + good[1][:30] + good[2] + b"\0" * 9 + good[3]
    frames = [f.sequence for f in FrameParser(4096).feed(stream)]
    assert frames == [0, 2, 3]


def test_frame_after_lost_payload_bytes_is_found() -> None:
    good = _frames(5, 48)
    stream = good[3][:-3] + good[4]
    parser = FrameParser(4096)
    assert [f.sequence for f in parser.feed(stream)] == [4]
    assert parser.bad_payloads == 1


def test_longer_payload_than_the_device_may_send_is_no_frame() -> None:
    assert FrameParser(4).feed(GOLDEN["frame"]) == []


def test_a_header_of_1_1_is_52_bytes_and_carries_the_window() -> None:
    raw = encode_frame(FRAME._replace(window=3), 52)
    assert raw[5] == 52
    assert raw[44:48] == b"\x03\x00\x00\x00"
    assert len(raw) == 52 + 8 + 4
    (found,) = FrameParser(4096).feed(raw)
    assert found.window == 3
    assert encode_frame(FRAME._replace(window=3), 48) == GOLDEN["frame"]


def test_samples_of_any_type_are_sent_as_the_format_says() -> None:
    assert encode_frame(FRAME._replace(samples=SAMPLES.astype(np.uint32))) == GOLDEN["frame"]
    one_byte = FRAME._replace(format=int(sbp.Format.U8), samples=np.array([1, 255], np.uint8))
    (found,) = FrameParser(2).feed(encode_frame(one_byte))
    assert found.samples.tolist() == [1, 255]
    assert found.samples.dtype == np.uint8


def test_what_is_lost_is_counted_byte_by_byte() -> None:
    good = _frames(3, 48)
    parser = FrameParser(4096)
    bad_header, bad_payload = bytearray(good[0]), bytearray(good[1])
    bad_header[20] ^= 1
    bad_payload[50] ^= 1
    assert parser.feed(bytes(bad_header)) == []
    assert (parser.bad_headers, parser.bad_payloads, parser.damaged) == (1, 0, 1)
    assert parser.skipped + parser.waiting == len(bad_header)
    assert parser.feed(bytes(bad_payload) + good[2])[0].sequence == 2
    assert (parser.bad_headers, parser.bad_payloads, parser.damaged) == (1, 1, 2)
    assert parser.skipped == len(bad_header) + len(bad_payload)
    assert parser.waiting == 0


def test_what_is_kept_is_only_what_may_begin_a_frame() -> None:
    good = _frames(1, 48)[0]
    for rest, kept in (
        (b"", 0),
        (b"x", 0),
        (b"S", 1),
        (b"xSL", 2),
        (b"SLR", 3),
        (b"SLRx", 0),
        (good[:5], 5),
        (good[:30], 30),
    ):
        parser = FrameParser(4096)
        assert len(parser.feed(good + rest)) == 1
        assert (parser.waiting, parser.skipped) == (kept, len(rest) - kept)
        parser.clear()
        assert (parser.waiting, parser.skipped) == (0, len(rest))
        assert len(parser.feed(good)) == 1


@pytest.mark.parametrize(("at", "value"), [(4, 2), (5, 47), (6, 2)])
def test_another_version_a_short_header_and_an_unknown_format_are_no_frames(at: int, value: int) -> None:
    header = bytearray(GOLDEN["frame"][:44])
    header[at] = value
    stream = sbp.seal(bytes(header)) + GOLDEN["frame"][48:]
    parser = FrameParser(4096)
    assert parser.feed(stream + GOLDEN["frame"])[0].samples.tolist() == [256, 260, 300, 512]
    assert parser.bad_headers == 1


@pytest.mark.parametrize(("payload_max", "frames"), [(7, 0), (8, 1)])
def test_the_largest_payload_is_allowed(payload_max: int, frames: int) -> None:
    assert len(FrameParser(payload_max).feed(GOLDEN["frame"])) == frames
