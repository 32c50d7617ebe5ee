"""Worked bytes of the Helios DAC, both ways."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.drivers.helios import Command, FrameFlag, GalvoFrame, wire

TRACE_FRAME = bytes.fromhex("00 00 00 00 00 00 00 80 01 23 ff 00 00 ff ff fa bc 01 02 03 04 20 4e 03 00 02")


def test_frame_of_the_trace_both_ways() -> None:
    frame = GalvoFrame(
        np.array([[0, 0], [0x800, 0x123], [0xFFF, 0xABC]], np.uint16),
        np.array([[0, 0, 0, 0], [255, 0, 0, 255], [1, 2, 3, 4]], np.uint8),
        20_000,
        FrameFlag.PLAY_ONCE,
    )
    assert wire.encode_frame(frame) == TRACE_FRAME
    found = wire.decode_frame(TRACE_FRAME)
    assert found is not None
    assert found.xy.tolist() == frame.xy.tolist()
    assert found.colours.tolist() == frame.colours.tolist()
    assert found[2:] == frame[2:]


def test_commands_of_the_trace() -> None:
    assert wire.encode_command(Command.FIRMWARE) == bytes.fromhex("04 00")
    assert wire.encode_command(Command.SDK_VERSION, wire.SDK_VERSION) == bytes.fromhex("07 0b")
    assert wire.encode_command(Command.NAME) == bytes.fromhex("05 00")
    assert wire.encode_command(Command.STATUS) == bytes.fromhex("03 00")
    assert wire.encode_command(Command.SHUTTER, 1) == bytes.fromhex("02 01")
    assert wire.encode_command(Command.STOP) == bytes.fromhex("01 00")
    assert wire.encode_name("Helios 123") == b"\x06Helios 123\0"
    assert wire.decode_name(b"Helios 123\0rubbish") == "Helios 123"


def test_command_that_erases_the_firmware_cannot_be_made() -> None:
    assert 0xDE not in set(Command)
    with pytest.raises(ValueError, match="222"):
        wire.encode_command(0xDE)  # type: ignore[arg-type]
    assert all(wire.encode_command(command, a)[0] != 0xDE for command in Command for a in range(256))


def test_frame_of_45_points_is_sent_as_44_at_a_scaled_rate() -> None:
    data = wire.encode_frame(wire.point_frame(1, 2, points=45, rate_hz=20_000))
    assert data[-5:].hex(" ") == "64 4c 2c 00 02"
    assert len(data) == 7 * 44 + 5


@given(n=st.integers(1, wire.POINTS_MAX))
@settings(deadline=None, max_examples=60)
def test_no_frame_is_a_multiple_of_a_packet(n: int) -> None:
    data = wire.encode_frame(wire.point_frame(7, 9, points=n))
    assert len(data) % wire.PACKET
    found = wire.decode_frame(data)
    assert found is not None
    assert len(found.xy) == n - (n % 64 == 45)


@given(st.lists(st.tuples(st.integers(0, 4095), st.integers(0, 4095), st.booleans()), min_size=1, max_size=44))
@settings(deadline=None, max_examples=60)
def test_path_survives_the_wire(points: list[tuple[int, int, bool]]) -> None:
    frame = wire.path_frame([p[:2] for p in points], [p[2] for p in points], 1000)
    found = wire.decode_frame(wire.encode_frame(frame))
    assert found is not None
    assert found.xy.tolist() == [list(p[:2]) for p in points]
    assert (found.colours[:, 2] > 127).tolist() == [p[2] for p in points]


def test_path_of_45_points_keeps_its_rate() -> None:
    frame = wire.path_frame([(k, 0) for k in range(45)], [False] * 44 + [True], 1000)
    found = wire.decode_frame(wire.encode_frame(frame))
    assert found is not None
    assert found.rate_hz == 1000
    assert found.xy[:, 0].tolist() == [*range(45), 44]


@given(st.binary(max_size=80))
@settings(deadline=None, max_examples=100)
def test_wrong_length_is_no_frame(data: bytes) -> None:
    found = wire.decode_frame(data)
    if len(data) >= 5 and len(data) == 7 * int.from_bytes(data[-3:-1], "little") + 5 and len(data) > 5:
        assert found is not None
    else:
        assert found is None


@pytest.mark.parametrize(
    ("xy", "marked", "rate_hz", "message"),
    [
        ([[0, 4096]], [False], 1000, "codes 0 to 4096 are not all within 0 to 4095"),
        ([[-1, 0]], [False], 1000, "codes -1 to 0"),
        ([[0, 0]], [False, True], 1000, "marked"),
        ([[0, 0]], [False], 6, "rate 6 points/s is outside 7 to 65535"),
        ([[0, 0]] * 4096, [False] * 4096, 1000, "1 to 4095 points, not 4096"),
        ([0, 0], [False], 1000, "xy is"),
    ],
)
def test_path_out_of_range_is_refused(xy: list[list[int]], marked: list[bool], rate_hz: int, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        wire.path_frame(xy, marked, rate_hz)


@pytest.mark.parametrize("name", ["", "x" * 21, "ü", "a\nb"])
def test_bad_name_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="printable ASCII"):
        wire.encode_name(name)


def test_limits_are_allowed_and_defaults_are_those_of_the_sheet() -> None:
    assert wire.encode_name("x" * 20)[1:21] == b"x" * 20
    assert wire.encode_name("x") == b"\x06x\0"
    frame = wire.point_frame(7, 9)
    assert (len(frame.xy), frame.rate_hz, frame.flags) == (10, 20_000, FrameFlag.PLAY_ONCE)
    assert not frame.colours.any()
    for rate_hz in (7, 65_535):
        assert wire.path_frame([[0, 4095]], [True], rate_hz).rate_hz == rate_hz
    assert len(wire.path_frame([[0, 0]] * 4095, [False] * 4095, 1000).xy) == 4095
    assert wire.path_frame([[0, 0], [1, 1]], [True, False], 1000).colours.tolist() == [[0, 0, 255, 0], [0, 0, 0, 0]]


def test_one_point_is_the_shortest_frame() -> None:
    assert wire.decode_frame(bytes(5)) is None
    one = wire.encode_frame(wire.point_frame(0xABC, 0x123, points=1))
    found = wire.decode_frame(one)
    assert found is not None
    assert found.xy.tolist() == [[0xABC, 0x123]]
    assert found.xy.dtype == np.uint16
    loud = wire.decode_frame(one[:3] + bytes([1, 2, 3, 4]) + one[7:-1] + b"\xff")
    assert loud is not None
    assert loud.colours.tolist() == [[1, 2, 3, 4]]
    assert loud.flags == FrameFlag.START_AT_ONCE | FrameFlag.PLAY_ONCE | FrameFlag.DO_NOT_BLOCK
