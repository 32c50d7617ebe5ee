"""Helios DAC: driver and firmware over the simulated bus, and the manufacturer's trace."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from picoradar.drivers.errors import DeviceFault, LimitError, LinkLost, Timeout
from picoradar.drivers.helios import FrameFlag, GalvoFrame, Helios, helios_link, wire
from picoradar.sim.firmware.helios.device import FirmwareErased
from picoradar.sim.usb import InTransfer


def _frame(xy: list[tuple[int, int]], flags: int, rate_hz: int = 1000, blue: tuple[int, ...] = ()) -> bytes:
    colours = np.zeros((len(xy), 4), np.uint8)
    colours[list(blue), 2] = 255
    return wire.encode_frame(GalvoFrame(np.array(xy, np.uint16), colours, rate_hz, FrameFlag(flags)))


def _places(bench: Any, since: float = 0.0) -> list[tuple[float, int, int]]:
    return [(round(t - since, 6), round(x * 2048) + 2048, round(y * 2048) + 2048) for t, x, y in bench.mirrors.seen]


def test_trace_of_the_sdk_replays(bench_1_0: Any, sdk_trace: list[tuple[str, int, bytes]]) -> None:
    bench = bench_1_0
    link = helios_link(bench.clock, bench.backend)
    link.open()
    for way, endpoint, data in sdk_trace:
        if way == "out":
            link.write(endpoint, data, timeout_s=0.032)
        else:
            assert link.read(endpoint, 32, timeout_s=0.032) == data
    assert bench.helios_firmware.sdk_version == 11
    bench.clock.sleep(0.2)
    assert _places(bench)[0][1:] == (0, 0)
    assert _places(bench)[-1][1:] == (2048, 2048)


def test_driver_opens_in_the_order_of_the_trace(bench_1_0: Any, sdk_trace: list[tuple[str, int, bytes]]) -> None:
    bench = bench_1_0
    sent: list[tuple[str, int, bytes]] = []
    firmware = bench.helios_firmware
    receive, take = firmware.receive, firmware.take

    def seen_receive(endpoint: int, data: bytes) -> bool:
        sent.append(("out", endpoint, data))
        return bool(receive(endpoint, data))

    def seen_take(endpoint: int) -> bytes | None:
        data: bytes | None = take(endpoint)
        if data is not None:
            sent.append(("in", endpoint, data))
        return data

    firmware.receive, firmware.take = seen_receive, seen_take
    bench.helios.open()
    assert bench.clock.now() >= 0.1
    bench.helios.move(0x800, 0x123)
    bench.helios.close()
    frame = [step for step in sent if step[1] == wire.EP_FRAME]
    assert [step for step in sent if step[1] != wire.EP_FRAME] == [s for s in sdk_trace if s[1] != wire.EP_FRAME]
    found = wire.decode_frame(frame[0][2])
    assert found is not None
    assert set(map(tuple, found.xy.tolist())) == {(0x800, 0x123)}
    assert found.flags == FrameFlag.PLAY_ONCE


def test_identity_and_name(bench_1_0: Any) -> None:
    helios = bench_1_0.helios
    helios.open()
    assert str(helios.identify()) == "Helios DAC, s/n Helios 123, firmware 6"
    helios.set_name("galvo 2")
    assert helios.name() == "galvo 2"
    with pytest.raises(LimitError, match="1 to 20"):
        helios.set_name("x" * 21)
    helios.close()
    other = Helios(helios_link(bench_1_0.clock, bench_1_0.backend), name="galvo 1")
    with pytest.raises(DeviceFault, match=r"'galvo 2'.*'galvo 1'"):
        other.open()
    assert not other.link.is_open


def test_move_is_played_when_its_frame_has_come(bench_1_0: Any) -> None:
    bench = bench_1_0
    bench.helios.open()
    bench.helios.move(0, 4095)
    begin = bench.clock.now()
    bench.helios.move(2048, 1024)
    assert _places(bench)[0][1:] == (0, 4095)
    assert _places(bench)[-1][1:] == (2048, 1024)
    assert bench.clock.now() - begin == pytest.approx(0.003)  # query, answer and frame: a full-speed frame each
    assert bench.mirrors.seen[-1][0] == pytest.approx(bench.clock.now())


@pytest.mark.parametrize("codes", [(-1, 0), (0, 4096), (float("nan"), 0)])
def test_code_out_of_range_is_refused(bench_1_0: Any, codes: tuple[int, int]) -> None:
    bench_1_0.helios.open()
    with pytest.raises(LimitError, match="outside 0 to 4095"):
        bench_1_0.helios.move(*codes)
    assert bench_1_0.mirrors.seen == []


def test_park_goes_to_the_centre(bench_1_0: Any) -> None:
    bench = bench_1_0
    bench.helios.open()
    bench.helios.move(0, 0)
    bench.helios.park()
    assert _places(bench)[-1][1:] == (2048, 2048)
    bench.clock.sleep(1.0)
    assert _places(bench)[-1][1:] == (2048, 2048)


def test_path_raises_the_marker_at_its_points(bench_1_0: Any) -> None:
    bench = bench_1_0
    bench.helios.open()
    rises: list[float] = []
    bench.helios_firmware.on_marker.append(lambda: rises.append(bench.clock.now()))
    xy = [(100, 0)] * 4 + [(200, 0)] * 4 + [(300, 0)] * 4
    bench.helios.play(xy, [False, False, True, True] * 3, 1000)
    begin = bench.clock.now()
    bench.clock.sleep(1.0)
    assert [round(t - begin, 6) for t in rises] == [0.002, 0.006, 0.010]
    assert _places(bench, begin) == [(0.0, 100, 0), (0.004, 200, 0), (0.008, 300, 0)]
    with pytest.raises(LimitError, match="nothing was sent"):
        bench.helios.play([(0, 5000)], [False], 1000)


@pytest.fixture
def raw(bench_1_0: Any) -> Any:
    link = helios_link(bench_1_0.clock, bench_1_0.backend)
    link.open()
    bench_1_0.link = link
    return bench_1_0


def _ready(bench: Any) -> int:
    bench.link.write(wire.EP_COMMAND, b"\x03\x00", timeout_s=0.016)
    answer = bench.link.read(wire.EP_ANSWER, 32, timeout_s=0.016)
    assert answer[0] == 0x83
    return int(answer[1])


def test_two_frames_are_buffered_and_a_third_waits(raw: Any) -> None:
    for k in range(2):
        assert _ready(raw) == 1
        raw.link.write(wire.EP_FRAME, _frame([(k, k)] * 100, FrameFlag.PLAY_ONCE), timeout_s=0.05)
    assert _ready(raw) == 0
    with pytest.raises(Timeout):
        raw.link.write(wire.EP_FRAME, _frame([(9, 9)] * 100, FrameFlag.PLAY_ONCE), timeout_s=0.02)
    begin = raw.clock.now()
    raw.link.write(wire.EP_FRAME, _frame([(2, 2)] * 100, FrameFlag.PLAY_ONCE), timeout_s=1.0)
    assert 0.05 < raw.clock.now() - begin < 0.1
    raw.clock.sleep(1.0)
    times, xs, _ys = zip(*_places(raw), strict=True)
    assert xs == (0, 1, 2)
    assert np.diff(times) == pytest.approx([0.1, 0.1])


def test_start_at_once_drops_what_plays(raw: Any) -> None:
    raw.link.write(wire.EP_FRAME, _frame([(1, 1)] * 1000, FrameFlag.PLAY_ONCE), timeout_s=0.05)
    raw.link.write(wire.EP_FRAME, _frame([(2, 2)] * 1000, FrameFlag.PLAY_ONCE), timeout_s=0.05)
    raw.link.write(wire.EP_FRAME, _frame([(3, 3)], FrameFlag.PLAY_ONCE | FrameFlag.START_AT_ONCE), timeout_s=0.05)
    raw.clock.sleep(3.0)
    assert [x for _, x, _ in _places(raw)] == [1, 3]


def test_repeating_frame_goes_on_until_the_next_one(raw: Any) -> None:
    raw.link.write(wire.EP_FRAME, _frame([(1, 1), (2, 2)], 0, rate_hz=100), timeout_s=0.05)
    raw.clock.sleep(0.095)
    raw.link.write(wire.EP_FRAME, _frame([(3, 3)], FrameFlag.PLAY_ONCE, rate_hz=100), timeout_s=0.05)
    raw.clock.sleep(1.0)
    assert [x for _, x, _ in _places(raw)] == [1, 2] * 5 + [3]


def test_unchanging_repeating_frame_ends_with_its_round(raw: Any) -> None:
    raw.link.write(wire.EP_FRAME, _frame([(1, 1)] * 10, 0, rate_hz=100), timeout_s=0.05)
    begin = raw.clock.now()
    raw.clock.sleep(60.05)
    raw.link.write(wire.EP_FRAME, _frame([(3, 3)], FrameFlag.PLAY_ONCE), timeout_s=0.05)
    raw.clock.sleep(1.0)
    assert _places(raw, begin)[1:] == [(60.1, 3, 3)]


def test_frame_of_wrong_length_is_dropped_silently(raw: Any) -> None:
    raw.link.write(wire.EP_FRAME, _frame([(1, 1)] * 3, FrameFlag.PLAY_ONCE)[1:], timeout_s=0.05)
    assert _ready(raw) == 1
    assert raw.mirrors.seen == []
    assert raw.helios_firmware.frames_dropped == 1


def test_frame_of_whole_packets_is_never_taken(raw: Any) -> None:
    trapped = bytes(7 * 45) + bytes.fromhex("20 4e 2d 00 02")
    assert len(trapped) % 64 == 0
    raw.link.write(wire.EP_FRAME, trapped, timeout_s=0.05)
    assert raw.mirrors.seen == []
    raw.link.write(wire.EP_FRAME, _frame([(1, 1)], FrameFlag.PLAY_ONCE), timeout_s=0.05)
    assert raw.mirrors.seen == []  # both together were taken for one frame of a wrong length
    raw.link.write(wire.EP_FRAME, trapped, timeout_s=0.05)
    assert _ready(raw) == 1  # the status query re-arms the reception
    raw.link.write(wire.EP_FRAME, _frame([(1, 1)], FrameFlag.PLAY_ONCE), timeout_s=0.05)
    assert [x for _, x, _ in _places(raw)] == [1]


def test_stop_ignores_frames_for_100_ms_and_then_centres(raw: Any) -> None:
    raw.link.write(wire.EP_FRAME, _frame([(1, 1)] * 1000, 0), timeout_s=0.05)
    raw.link.write(wire.EP_COMMAND, b"\x01\x00", timeout_s=0.016)
    begin = raw.clock.now()
    raw.link.write(wire.EP_FRAME, _frame([(2, 2)], FrameFlag.PLAY_ONCE), timeout_s=0.05)
    raw.clock.sleep(1.0)
    assert _places(raw, begin)[1:] == [(0.1, 2048, 2048)]


def test_erase_command_is_a_fatal_error(raw: Any) -> None:
    with pytest.raises(FirmwareErased, match="0xDE"):
        raw.link.write(wire.EP_COMMAND, b"\xde\x00", timeout_s=0.016)


def test_alternate_setting_0_has_no_endpoints_and_stops_output(raw: Any) -> None:
    raw.link.write(wire.EP_FRAME, _frame([(1, 1), (2, 2)], 0), timeout_s=0.05)
    raw.link.close()
    seen = len(raw.mirrors.seen)
    raw.clock.sleep(1.0)
    assert len(raw.mirrors.seen) == seen
    raw.link.alternate = 0
    raw.link.open()
    with pytest.raises(ValueError, match="Invalid endpoint"):
        raw.link.read(wire.EP_ANSWER, 32, timeout_s=0.01)


def test_late_answer_is_not_taken_for_the_next(bench_1_0: Any) -> None:
    bench = bench_1_0
    bench.helios.open()
    device = bench.backend.device_of(bench.helios_firmware)
    held: list[bytes] = []

    def hold_first(endpoint: int, data: bytes) -> list[Any]:
        if not held:
            held.append(data)
            return []
        return [InTransfer(d) for d in (held.pop(0), data)]

    device.tamper = hold_first
    assert bench.helios.firmware_version() == 6  # first answer late: asked again, both come
    device.tamper = None
    assert bench.helios.name() == "Helios 123"


def test_silent_device_is_a_timeout_and_a_pulled_one_is_lost(bench_1_0: Any) -> None:
    bench = bench_1_0
    bench.helios.open()
    bench.backend.device_of(bench.helios_firmware).tamper = lambda endpoint, data: []
    begin = bench.clock.now()
    with pytest.raises(Timeout):
        bench.helios.ready()
    assert bench.clock.now() - begin < 0.1
    bench.backend.unplug(bench.helios_firmware)
    with pytest.raises(LinkLost):
        bench.helios.move(1, 1)
    bench.helios.close()
    bench.backend.plug(bench.helios_firmware)
    bench.helios.open()
    bench.helios.move(1, 1)
    bench.helios.close()
