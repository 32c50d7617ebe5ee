"""Firmware of the sampling bridge as any client sees it: every refusal, queue, format and way to stop."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from picoradar.drivers.bridge import bridge_link, sbp
from picoradar.drivers.bridge.sbp import (
    ConfigFlag,
    Configuration,
    ErrorCode,
    EventKind,
    Frame,
    FrameFlag,
    FrameParser,
    Request,
    State,
)
from picoradar.drivers.errors import ProtocolError, Stall, Timeout
from picoradar.drivers.interfaces import SweepSettings

CONFIG = Configuration(5_000_000, 6_700, 100, 8, ConfigFlag.EXTERNAL_TRIGGER, 1, 80_000, sbp.Format.U16, 0)
RECORD_S = 8 * 100 / 80_000


class Client:
    """A client that is not our driver: requests and reads, nothing more."""

    def __init__(self, bench: Any) -> None:
        self.bench = bench
        self.link = bridge_link(bench.clock, backend=bench.backend)
        self.link.open()
        self.parser = FrameParser(4096)

    def out(self, request: int, value: int = 0, data: bytes = b"") -> None:
        self.link.control_out(request, value, data)

    def refused(self, request: int, value: int = 0, data: bytes = b"") -> tuple[ErrorCode, int]:
        """Send what has to be refused; returns code and detail."""
        with pytest.raises(Stall):
            self.out(request, value, data)
        entry = self.error()
        assert (entry.request, entry.left) == (request, 0)
        return ErrorCode(entry.code), entry.detail

    def error(self) -> sbp.ErrorEntry:
        return sbp.ErrorEntry.decode(self.link.control_in(Request.GET_ERROR, 0, 8))

    def status(self) -> sbp.Status:
        return sbp.Status.decode(self.link.control_in(Request.GET_STATUS, 0, 32))

    def configure(self, configuration: Configuration = CONFIG) -> None:
        self.out(Request.SET_CONFIG, 0, configuration.encode())

    def start(self, run_id: int = 7) -> None:
        self.out(Request.START, 0, struct.pack("<I", run_id))

    def frames(self, limit_s: float = 0.1) -> list[Frame]:
        """Read until nothing comes."""
        found: list[Frame] = []
        while True:
            try:
                found += self.parser.feed(self.link.read(sbp.EP_DATA, 4608, timeout_s=limit_s))
            except Timeout:
                return found

    def events(self) -> list[sbp.Event]:
        found: list[sbp.Event] = []
        while True:
            try:
                found.append(sbp.Event.decode(self.link.read(sbp.EP_EVENT, 16, timeout_s=0.02)))
            except Timeout:
                return found


@pytest.fixture
def client(bench_1_0: Any) -> Client:
    return Client(bench_1_0)


def _sealed(**change: int) -> bytes:
    return replace(CONFIG, **change).encode()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("block", "code", "detail"),
    [
        (CONFIG.encode()[:-1], ErrorCode.BAD_LENGTH, 39),
        (b"\x29" + CONFIG.encode()[1:], ErrorCode.BAD_LENGTH, 40),
        (sbp.seal(CONFIG.encode()[:3] + b"\x02" + CONFIG.encode()[4:-4]), ErrorCode.BAD_VERSION, 0x0200),
        (CONFIG.encode()[:-1] + b"\x00", ErrorCode.BAD_CRC, 0x0100),
        (_sealed(step_fs=999, samples=0), ErrorCode.STEP_RANGE, 999),
        (_sealed(step_fs=100_100), ErrorCode.STEP_RANGE, 100_100),
        (_sealed(step_fs=6_750), ErrorCode.STEP_RESOLUTION, 6_750),
        (_sealed(start_fs=50), ErrorCode.STEP_RESOLUTION, 50),
        (_sealed(samples=0, averages=0), ErrorCode.COUNT_RANGE, 0),
        (_sealed(samples=16_385), ErrorCode.COUNT_RANGE, 16_385),
        (_sealed(start_fs=3_999_999_900), ErrorCode.WINDOW_RANGE, 4_000_663),
        (_sealed(averages=0, prf_hz=1), ErrorCode.AVERAGES_RANGE, 0),
        (_sealed(averages=257), ErrorCode.AVERAGES_RANGE, 257),
        (_sealed(prf_hz=19_999, format=9), ErrorCode.PRF_RANGE, 19_999),
        (_sealed(prf_hz=0), ErrorCode.PRF_RANGE, 0),
        (_sealed(prf_hz=240_001), ErrorCode.PRF_RANGE, 240_001),
        (_sealed(format=2, flags=64), ErrorCode.FORMAT, 2),
        (_sealed(flags=8), ErrorCode.FLAGS, 8),
    ],
)
def test_first_check_that_fails_is_reported(client: Client, block: bytes, code: ErrorCode, detail: int) -> None:
    assert client.refused(Request.SET_CONFIG, 0, block) == (code, detail)
    with pytest.raises(Stall):
        client.link.control_in(Request.GET_CONFIG, 0, 40)
    assert client.error().code == ErrorCode.NOT_CONFIGURED


def test_other_refusals(client: Client) -> None:
    run = struct.pack("<I", 1)
    assert client.refused(0x99) == (ErrorCode.UNKNOWN_REQUEST, 0x99)
    assert client.refused(Request.START, 0, run) == (ErrorCode.NOT_CONFIGURED, 0)
    assert client.refused(Request.START, 0, b"123") == (ErrorCode.BAD_LENGTH, 3)
    assert client.refused(Request.SET_CONFIG, 2, CONFIG.encode()) == (ErrorCode.BAD_VALUE, 2)
    client.out(Request.SET_CONFIG, 1, CONFIG.encode())
    assert client.refused(Request.START, 0, run) == (ErrorCode.NOT_CONFIGURED, 0)  # that was a check only
    client.configure()
    assert client.refused(Request.START, 0, bytes(4)) == (ErrorCode.BAD_VALUE, 0)
    assert client.refused(Request.STOP, 2) == (ErrorCode.BAD_VALUE, 2)
    assert client.refused(Request.STOP, 0, b"x") == (ErrorCode.BAD_LENGTH, 1)
    assert client.refused(Request.RESET, 1) == (ErrorCode.BAD_VALUE, 1)
    assert client.refused(Request.SET_WATCHDOG, 0) == (ErrorCode.BAD_VALUE, 0)
    assert client.refused(Request.SET_WATCHDOG, 5001) == (ErrorCode.BAD_VALUE, 5001)
    assert client.refused(Request.LASER, 3, b"RSAL") == (ErrorCode.BAD_VALUE, 3)
    assert client.refused(Request.LASER, 1, b"RSA") == (ErrorCode.BAD_LENGTH, 3)
    assert client.refused(Request.LASER, 0, b"RSAL") == (ErrorCode.BAD_LENGTH, 4)
    assert client.refused(Request.LASER, 2, b"XXXX") == (ErrorCode.BAD_KEY, 0x58585858)
    assert client.refused(Request.HEARTBEAT, 0, b"") == (ErrorCode.BAD_LENGTH, 0)
    client.start()
    assert client.refused(Request.START, 0, run) == (ErrorCode.BUSY, State.RUNNING)
    assert client.refused(Request.SET_CONFIG, 0, CONFIG.encode()) == (ErrorCode.BUSY, State.RUNNING)
    assert client.refused(Request.FLUSH) == (ErrorCode.BUSY, State.RUNNING)
    client.out(Request.STOP, 1)
    client.out(Request.STOP, 1)
    client.out(Request.FLUSH)
    assert client.error().code == ErrorCode.OK


def test_another_major_version_is_refused_by_the_driver(bench_1_0: Any) -> None:
    firmware = bench_1_0.bridge_firmware
    firmware.info = replace(firmware.info, version=0x0200)
    with pytest.raises(ProtocolError, match=r"version 2\.0, only 1\.x"):
        bench_1_0.bridge.open()
    assert not bench_1_0.bridge.link.is_open
    firmware.info = replace(firmware.info, version=0x0107)
    bench_1_0.bridge.open()


def test_full_error_queue_says_so(client: Client) -> None:
    for request in range(0x80, 0x80 + 20):
        with pytest.raises(Stall):
            client.out(request)
    assert client.status().errors == 16
    entries = [client.error() for _ in range(17)]
    assert [e.request for e in entries[:15]] == list(range(0x80, 0x8F))
    assert [e.left for e in entries] == [*range(15, -1, -1), 0]
    assert entries[15].code == ErrorCode.QUEUE_FULL
    assert entries[16].code == ErrorCode.OK


def test_test_pattern_in_both_formats(client: Client) -> None:
    flags = ConfigFlag.EXTERNAL_TRIGGER | ConfigFlag.TEST_PATTERN
    codes = (np.arange(600)[None, :] + np.arange(5)[:, None]) % 256
    for form, expected in (
        (sbp.Format.U16, codes.sum(axis=0)),
        (sbp.Format.U8, np.floor(codes.sum(axis=0) / 5 + 0.5)),
    ):
        client.configure(replace(CONFIG, samples=600, averages=5, flags=flags, format=form))
        client.start()
        (frame,) = client.frames()
        assert frame.flags == FrameFlag.FIRST | FrameFlag.LAST | FrameFlag.END_OF_RUN | FrameFlag.TEST_PATTERN
        assert frame.samples.tolist() == expected.tolist()
        assert frame.samples.dtype.itemsize == form + 1


def test_internal_trigger_needs_no_trigger_line(client: Client) -> None:
    client.bench.trigger.rate_hz = 0.0
    client.configure(replace(CONFIG, flags=ConfigFlag(0), prf_hz=20_000))
    assert client.status().trigger_mhz == 20_000_000
    client.start()
    begin = client.bench.clock.now()
    client.link.read(sbp.EP_DATA, 4608, timeout_s=1.0)
    assert client.bench.clock.now() - begin == pytest.approx(8 * 100 / 20_000, abs=3e-4)


def test_stop_at_the_end_of_the_record(client: Client) -> None:
    client.configure(replace(CONFIG, records=0))
    client.start()
    client.bench.clock.sleep(2.5 * RECORD_S)
    client.out(Request.STOP, 0)
    assert client.status().state is State.STOPPING
    frames = client.frames()
    assert [f.record for f in frames] == [0, 1, 2]
    assert [bool(f.flags & FrameFlag.END_OF_RUN) for f in frames] == [False, False, True]
    assert (client.status().state, client.status().records) == (State.IDLE, 3)


def test_stop_at_once_gives_the_sweeps_taken_so_far(client: Client) -> None:
    client.configure()
    client.start()
    client.bench.clock.sleep(0.45 * RECORD_S)
    client.out(Request.STOP, 1)
    (frame,) = client.frames()
    assert frame.sweeps == 3
    assert frame.samples[:3].tolist() == [0, 3, 6]
    assert frame.flags & FrameFlag.END_OF_RUN
    client.start()
    client.bench.clock.sleep(0.05 * RECORD_S)
    client.out(Request.STOP, 1)
    assert client.frames() == []
    assert client.status().state is State.IDLE


def test_overrun_drops_the_newest_and_flags_the_next(client: Client) -> None:
    client.configure(replace(CONFIG, records=70, averages=1))
    client.start()
    client.bench.clock.sleep(67.5 * RECORD_S / 8)
    status = client.status()
    assert (status.frames_lost, bool(status.flags & sbp.StatusFlag.FRAMES_LOST)) == (3, True)
    frames = client.frames()
    assert [f.sequence for f in frames] == [*range(64), 67, 68, 69]
    assert [f.sequence for f in frames if f.flags & FrameFlag.LOST_BEFORE] == [67]
    errors = [client.error() for _ in range(3)]
    assert [(e.code, e.request, e.detail) for e in errors] == [(ErrorCode.OVERRUN, 0, n) for n in (1, 2, 3)]
    assert EventKind.OVERRUN in [e.kind for e in client.events()]


def test_flush_throws_frames_away_and_start_does_too(client: Client) -> None:
    client.configure()
    for request in (Request.FLUSH, None):
        client.start(5)
        client.bench.clock.sleep(2 * RECORD_S)
        if request is not None:
            client.out(request)
            assert client.frames() == []
    client.start(6)
    assert [f.run_id for f in client.frames()] == [6]


def test_events_tell_a_run(client: Client) -> None:
    client.configure()
    client.out(Request.HEARTBEAT, 0, struct.pack("<I", 9))
    client.out(Request.LASER, 1, b"RSAL")
    client.start()
    client.bench.clock.sleep(2 * RECORD_S)
    reported = [(e.kind, e.argument) for e in client.events()]
    assert reported == [
        (EventKind.GATE, sbp.Gate.ON),
        (EventKind.STATE, State.WAIT),
        (EventKind.STATE, State.RUNNING),
        (EventKind.RECORD_DONE, 0),
        (EventKind.STATE, State.IDLE),
    ]


@pytest.mark.parametrize("way", ["reset request", "bus reset", "unconfigured", "unplugged"])
def test_every_kind_of_reset_closes_the_gate(client: Client, way: str) -> None:
    bench = client.bench
    client.configure(replace(CONFIG, records=0))
    client.out(Request.HEARTBEAT, 0, struct.pack("<I", 9))
    client.out(Request.LASER, 1, b"RSAL")
    client.start()
    assert bench.bridge_firmware.gate_open
    device = bench.backend.device_of(bench.bridge_firmware)
    match way:
        case "reset request":
            client.out(Request.RESET, sbp.RESET_VALUE)
        case "bus reset":
            device.reset()
        case "unconfigured":
            device.configure(0)
        case _:
            bench.backend.unplug(bench.bridge_firmware)
    status = bench.bridge_firmware.status()
    assert (status.gate, status.state, status.watchdog_ms) == (sbp.Gate.OFF, State.IDLE, 0)
    assert not status.flags & sbp.StatusFlag.CONFIGURED


def test_reset_does_not_end_a_lock_out(client: Client) -> None:
    client.bench.interlock.closed = False
    client.bench.interlock.closed = True
    client.out(Request.RESET, sbp.RESET_VALUE)
    assert client.status().gate is sbp.Gate.LOCKED
    client.out(Request.LASER, 2, b"RSAL")
    assert client.status().gate is sbp.Gate.OFF


def test_watchdog_with_the_gate_off_does_nothing(client: Client) -> None:
    client.configure()
    client.out(Request.HEARTBEAT, 0, struct.pack("<I", 9))
    assert client.status().watchdog_ms > 990
    client.bench.clock.sleep(2.0)
    status = client.status()
    assert (status.watchdog_ms, status.gate, status.state, status.errors) == (0, sbp.Gate.OFF, State.IDLE, 0)
    client.out(Request.HEARTBEAT, 0, struct.pack("<I", 10))
    client.out(Request.SET_WATCHDOG, 100)
    client.out(Request.LASER, 1, b"RSAL")
    client.bench.clock.sleep(0.0985)
    assert client.bench.bridge_firmware.gate_open
    client.bench.clock.sleep(0.002)
    assert not client.bench.bridge_firmware.gate_open


def test_gate_may_be_kept_off_between_records(bench_1_1: Any) -> None:
    client = Client(bench_1_1)
    flags = ConfigFlag.EXTERNAL_TRIGGER | ConfigFlag.GATE_BETWEEN | ConfigFlag.ADVANCE
    client.configure(replace(CONFIG, flags=flags, records=2))
    client.out(Request.HEARTBEAT, 0, struct.pack("<I", 9))
    client.out(Request.LASER, 1, b"RSAL")
    client.start()
    assert not bench_1_1.bridge_firmware.gate_open
    bench_1_1.bridge_firmware.advance()
    assert bench_1_1.bridge_firmware.gate_open
    bench_1_1.clock.sleep(2 * RECORD_S)
    assert not bench_1_1.bridge_firmware.gate_open
    assert client.status().gate is sbp.Gate.ON


def test_clipping_is_told_in_frame_and_status(client: Client) -> None:
    client.bench.source.clipped = True
    client.configure()
    client.start()
    (frame,) = client.frames()
    assert frame.flags & FrameFlag.CLIPPED
    assert client.status().flags & sbp.StatusFlag.CLIPPING_SEEN
    client.start()
    assert not client.status().flags & sbp.StatusFlag.CLIPPING_SEEN


def test_stale_frames_of_a_former_run_are_dropped(bench_1_0: Any) -> None:
    bench = bench_1_0
    bench.bridge.open()
    bench.bridge.configure(SweepSettings(5000.0, 6.7, 100, 8, 0, 80_000.0))
    kept: list[bytes] = []

    def keep(frame: bytes) -> bytes:
        kept.append(frame)
        return b"".join(kept)

    bench.bridge_firmware.acquirer.queue.fault = keep
    for run_id in (1, 2, 3):
        (record,) = bench.bridge.take(run_id)
        assert record.run_id == run_id
    assert bench.bridge.retried == 0


def test_windows_that_are_refused(bench_1_1: Any) -> None:
    client = Client(bench_1_1)
    good = sbp.WindowEntry(4_200_000, 6_700, 96, 1)
    block = sbp.encode_windows([[good]])
    assert client.refused(Request.SET_WINDOWS, 0, block) == (ErrorCode.NOT_CONFIGURED, 0)
    client.configure(replace(CONFIG, flags=ConfigFlag.EXTERNAL_TRIGGER | ConfigFlag.WINDOWS, step_fs=0, samples=0))
    assert client.refused(Request.SET_WINDOWS, 0, block[:-1])[0] is ErrorCode.BAD_LENGTH
    assert client.refused(Request.SET_WINDOWS, 0, block[:-1] + b"\x00")[0] is ErrorCode.BAD_CRC
    assert client.refused(Request.SET_WINDOWS, 0, sbp.encode_windows([[good] * 9])) == (ErrorCode.BAD_VALUE, 9)
    assert client.refused(Request.SET_WINDOWS, 0, sbp.encode_windows([[good]] * 253)) == (ErrorCode.BAD_VALUE, 253)
    assert client.refused(Request.SET_WINDOWS, 2, block) == (ErrorCode.BAD_VALUE, 2)
    none = sbp.seal(struct.pack("<HHHH", 12, 0x0101, 1, 0))
    assert client.refused(Request.SET_WINDOWS, 0, none) == (ErrorCode.BAD_VALUE, 0)
    for window, code in (
        (replace(good, step_fs=0), ErrorCode.STEP_RANGE),
        (replace(good, samples=0), ErrorCode.COUNT_RANGE),
        (replace(good, sweeps=257), ErrorCode.AVERAGES_RANGE),
        (replace(good, start_fs=4_000_000_000), ErrorCode.WINDOW_RANGE),
    ):
        table = sbp.encode_windows([[good, good], [good, window]])
        assert client.refused(Request.SET_WINDOWS, 0, table) == (code, 3)


def test_run_waits_for_the_next_table(bench_1_1: Any) -> None:
    client = Client(bench_1_1)
    client.configure(replace(CONFIG, flags=ConfigFlag.EXTERNAL_TRIGGER | ConfigFlag.WINDOWS, records=0))
    client.start()
    assert client.status().state is State.WAIT
    for start_fs in (4_200_000, 9_800_000):
        table = sbp.encode_windows([[sbp.WindowEntry(start_fs, 6_700, 96, 1)] * 2] * 2)
        client.out(Request.SET_WINDOWS, 1, table)
        assert client.status().state is State.WAIT
        client.out(Request.SET_WINDOWS, 0, table)
        assert client.refused(Request.SET_WINDOWS, 0, table) == (ErrorCode.BUSY, State.RUNNING)
        frames = client.frames()
        assert [(f.window, f.first) for f in frames] == [(0, 0), (1, 0)] * 2
        assert [w.delay_ps for w in bench_1_1.source.wanted[-4:]] == [start_fs / 1000] * 4
        assert client.status().state is State.WAIT
    assert [f.record for f in frames] == [2, 2, 3, 3]
    client.out(Request.STOP, 0)
    assert client.status().state is State.IDLE
