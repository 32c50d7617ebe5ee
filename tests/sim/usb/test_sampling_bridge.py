"""Sampling bridge: driver and firmware over the simulated bus."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest

from picoradar.drivers.bridge import bridge_link, sbp
from picoradar.drivers.bridge.sbp import ErrorCode, FrameFlag, FrameParser, Request, WindowEntry
from picoradar.drivers.errors import DeviceFault, LimitError, LinkLost, ProtocolError, Stall
from picoradar.drivers.interfaces import SweepSettings
from picoradar.drivers.traces import Window

SWEEP = SweepSettings(start_ps=5000.0, step_ps=6.7, samples=1430, averages=8, settle_shots=16, prf_hz=80_000.0)


@pytest.fixture
def ready(bench: Any) -> Any:
    """Give a bench that is configured, fed and has its gate open."""
    bench.bridge.open()
    bench.bridge.configure(SWEEP)
    bench.beat()
    bench.bridge.gate_on()
    return bench


def test_worked_blocks_come_from_the_device(bench_1_0: Any, golden: dict[str, bytes]) -> None:
    link = bridge_link(bench_1_0.clock, serial_number="SB-0001", backend=bench_1_0.backend)
    link.open()
    assert link.control_in(Request.GET_INFO, 0, 64) == golden["info"]
    assert link.control_in(Request.GET_CAPS, 0, 64) == golden["caps_1_0"]
    link.control_out(Request.SET_CONFIG, 0, golden["config"])
    assert link.control_in(Request.GET_CONFIG, 0, 40) == golden["config"]
    link.close()
    with pytest.raises(LinkLost, match="SB-0002"):
        bridge_link(bench_1_0.clock, serial_number="SB-0002", backend=bench_1_0.backend).open()


def test_worked_status_and_frame_come_from_the_device(bench_1_0: Any, golden: dict[str, bytes]) -> None:
    bench = bench_1_0
    link = bridge_link(bench.clock, backend=bench.backend)
    link.open()
    link.control_out(Request.SET_CONFIG, 0, golden["config"])
    link.control_out(Request.HEARTBEAT, 0, struct.pack("<I", 1))
    link.control_out(Request.LASER, 1, golden["laser_key"])
    link.control_out(Request.START, 0, struct.pack("<I", 7))
    bench.clock.sleep(0.1296)
    assert link.control_in(Request.GET_STATUS, 0, 32) == golden["status"]
    (frame,) = FrameParser(4096).feed(link.read(sbp.EP_DATA, 4608, timeout_s=1.0))
    (worked,) = FrameParser(4096).feed(golden["frame"])
    same = worked._replace(flags=worked.flags | FrameFlag.END_OF_RUN)
    assert frame[:-1] == same[:-1]
    assert len(frame.samples) == 1430


def test_worked_windows_are_accepted_by_1_1_and_unknown_to_1_0(bench: Any, golden: dict[str, bytes]) -> None:
    link = bridge_link(bench.clock, backend=bench.backend)
    link.open()
    link.control_out(Request.SET_CONFIG, 0, golden["config"])
    if bench.bridge_firmware.info.version == sbp.VERSION_1_1:
        assert link.control_in(Request.GET_CAPS, 0, 72) == golden["caps_1_1"]
        link.control_out(Request.SET_WINDOWS, 0, golden["windows"])
    else:
        with pytest.raises(Stall):
            link.control_out(Request.SET_WINDOWS, 0, golden["windows"])
        assert link.control_in(Request.GET_ERROR, 0, 8) == bytes.fromhex("04 00 12 00 12 00 00 00")
    link.close()


def test_worked_refusal_and_event(bench: Any, golden: dict[str, bytes]) -> None:
    link = bridge_link(bench.clock, backend=bench.backend)
    link.open()
    with pytest.raises(Stall):
        link.control_out(Request.SET_CONFIG, 0, golden["config_step_refused"])
    code, request, left, detail = struct.unpack("<HBBI", link.control_in(Request.GET_ERROR, 0, 8))
    assert (code, request, left, detail) == (ErrorCode.STEP_RANGE, Request.SET_CONFIG, 0, 500)
    assert link.control_in(Request.GET_ERROR, 0, 8) == bytes(8)
    event = sbp.Event.decode(link.read(sbp.EP_EVENT, 16, timeout_s=0.1))
    assert (event.kind, event.error) == (sbp.EventKind.ERROR, ErrorCode.STEP_RANGE)
    link.close()


def test_driver_sends_the_worked_configuration(bench: Any, golden: dict[str, bytes]) -> None:
    bench.bridge.open()
    bench.bridge.configure(SWEEP)
    assert bench.bridge.link.control_in(Request.GET_CONFIG, 0, 40) == golden["config"]
    assert bench.bridge.identify().serial_number == "SB-0001"
    assert bench.bridge.identify().firmware == "firmware 1.2"


def test_record_takes_the_time_of_its_shots(ready: Any) -> None:
    begin = ready.clock.now()
    (record,) = ready.bridge.take(7)
    assert ready.clock.now() - begin == pytest.approx(SWEEP.record_s, abs=0.001)
    assert record.sums.tolist() == ((np.arange(1430) % 200) * 8).tolist()
    assert (record.sweeps, record.run_id, record.number) == (8, 7, 0)
    assert record.times_ps[[0, -1]] == pytest.approx([5000.0, 5000.0 + 6.7 * 1429])
    assert record.trace_mv[:3] == pytest.approx([-16.0, -15.5, -15.0])
    wanted = ready.source.wanted[-1]
    assert (wanted.key, wanted.gate_open, wanted.sweeps, wanted.samples) == ((7, 0, 0, 0), True, 8, 1430)
    assert wanted.start_s == pytest.approx(begin, abs=0.001)


def test_long_records_cross_in_several_frames(bench: Any) -> None:
    bench.bridge.open()
    bench.bridge.configure(SweepSettings(1000.0, 1.0, 10_000, 2, 0, 80_000.0))
    records = bench.bridge.take(3, records=3)
    assert [r.number for r in records] == [0, 1, 2]
    for number, record in enumerate(records):
        assert record.sums.tolist() == (((np.arange(10_000) + 3 * number) % 200) * 2).tolist()
        assert record.device_time_us == pytest.approx(number * 250_000, abs=2)


def test_same_run_id_brings_new_noise_once_it_was_delivered(ready: Any) -> None:
    for repeat in range(3):
        ready.bridge.take(1)
        assert ready.source.wanted[-1].key == (1, repeat, 0, 0)
    ready.bridge.take(2)
    assert ready.source.wanted[-1].key == (2, 0, 0, 0)


@pytest.mark.parametrize("kind", ["lost", "header", "payload", "duplicated"])
def test_spoiled_run_is_taken_again_with_the_same_data(ready: Any, kind: str) -> None:
    faults = iter([True])

    def corrupt(frame: bytes) -> bytes | None:
        if not next(faults, False):
            return frame
        at = {"header": 10, "payload": 60}.get(kind, 0)
        altered = bytearray(frame)
        altered[at] ^= 0x10
        return {"lost": None, "duplicated": frame + frame}.get(kind, bytes(altered))

    ready.bridge.configure(SweepSettings(5000.0, 6.7, 100, 1, 0, 80_000.0))
    ready.bridge_firmware.acquirer.queue.fault = corrupt
    records = ready.bridge.take(5, records=2)
    assert [r.sums.tolist() for r in records] == [((np.arange(100) + 3 * n) % 200).tolist() for n in (0, 1)]
    assert ready.bridge.retried == 1
    assert {w.key[:2] for w in ready.source.wanted} == {(5, 0)}


def test_run_that_stays_spoiled_is_an_error(ready: Any) -> None:
    ready.bridge_firmware.acquirer.queue.fault = lambda frame: frame[:-1] + b"x"
    with pytest.raises(ProtocolError, match="corrupted 3 times"):
        ready.bridge.take(5)
    ready.bridge_firmware.acquirer.queue.fault = None
    assert len(ready.bridge.take(6)) == 1


def test_stalled_endpoint_is_cleared_and_the_run_taken_again(ready: Any) -> None:
    device = ready.backend.device_of(ready.bridge_firmware)
    device.halted.add(sbp.EP_DATA)
    assert len(ready.bridge.take(5)) == 1
    assert ready.bridge.retried == 1


def test_missing_triggers_are_named(ready: Any) -> None:
    ready.trigger.rate_hz = 0.0
    begin = ready.clock.now()
    with pytest.raises(DeviceFault, match="no triggers"):
        ready.bridge.take(5)
    assert ready.clock.now() - begin == pytest.approx(3 * SWEEP.record_s + 0.5, abs=0.01)
    assert ready.bridge.status().state == "idle"


def test_late_triggers_start_the_record(ready: Any) -> None:
    ready.trigger.rate_hz = 0.0
    ready.clock.call_at(ready.clock.now() + 0.2, lambda: setattr(ready.trigger, "rate_hz", 80_000.0))
    begin = ready.clock.now()
    ready.bridge.take(5)
    assert ready.clock.now() - begin == pytest.approx(0.2 + SWEEP.record_s, abs=0.003)


def test_trigger_lost_inside_is_flagged_and_the_record_taken_anew(ready: Any) -> None:
    now = ready.clock.now()
    ready.clock.call_at(now + 0.05, lambda: setattr(ready.trigger, "rate_hz", 0.0))
    ready.clock.call_at(now + 0.25, lambda: setattr(ready.trigger, "rate_hz", 80_000.0))
    (record,) = ready.bridge.take(5)
    assert record.trigger_lost
    assert "TRIGGER_LOST" in ready.bridge.status().problem
    assert ready.bridge.status().problem == ""


def test_rate_that_is_off_is_reported(ready: Any) -> None:
    ready.trigger.rate_hz = 80_000.0 * 1.03
    ready.bridge.take(5)
    assert "TRIGGER_RATE" in ready.bridge.status().problem
    ready.trigger.rate_hz = 80_000.0 * 1.019
    ready.bridge.take(6)
    assert ready.bridge.status().problem == ""


def test_silent_host_closes_the_gate_and_recovery_is_explicit(bench: Any) -> None:
    bridge = bench.bridge
    bridge.open()
    bridge.configure(SWEEP)
    bridge.heartbeat()
    bridge.gate_on()
    begin = bench.clock.now()
    bench.clock.sleep(0.9)
    assert bench.bridge_firmware.gate_open
    with pytest.raises(DeviceFault, match=r"FAULT.*WATCHDOG_TRIPPED"):
        bridge.take(7)
    assert bench.bridge_firmware.gate.changed_at == pytest.approx(begin + 1.0, abs=0.002)
    status = bridge.status()
    assert (status.state, status.gate) == ("fault", "locked")
    assert status.watchdog_left_s == 0.0
    bridge.heartbeat()
    with pytest.raises(DeviceFault, match="LASER_LOCKED"):
        bridge.gate_on()
    with pytest.raises(DeviceFault, match="BUSY"):
        bridge.take(8)
    bridge.clear_lockout()
    assert bridge.status().gate == "off"
    bridge.gate_on()
    assert bridge.status().gate == "on"


def test_worked_event_of_the_watchdog(bench_1_0: Any, golden: dict[str, bytes]) -> None:
    bench = bench_1_0
    link = bridge_link(bench.clock, backend=bench.backend)
    link.open()
    link.control_out(Request.SET_CONFIG, 0, golden["config"])
    link.control_out(Request.START, 0, struct.pack("<I", 7))
    bench.clock.sleep(0.2340001 - bench.clock.now())
    link.control_out(Request.HEARTBEAT, 0, struct.pack("<I", 1))
    link.control_out(Request.LASER, 1, golden["laser_key"])
    bench.clock.sleep(2.0)
    events = []
    while link.is_open and (not events or events[-1] != golden["event"]):
        events.append(link.read(sbp.EP_EVENT, 16, timeout_s=0.1))
    assert events[-1] == golden["event"]


def test_heartbeats_run_while_a_long_record_is_waited_for(bench: Any) -> None:
    bench.bridge.open()
    bench.bridge.configure(SweepSettings(1000.0, 1.0, 16_384, 100, 0, 20_000.0))  # 82 s
    bench.beat()
    bench.bridge.gate_on()
    bench.bridge.take(1)
    assert bench.bridge.status().gate == "on"


def test_interlock_closes_the_gate_and_locks_it(ready: Any) -> None:
    ready.clock.call_at(ready.clock.now() + 0.05, lambda: setattr(ready.interlock, "closed", False))
    ready.bridge.take(7)
    assert not ready.source.wanted[-1].gate_open
    status = ready.bridge.status()
    assert (status.gate, status.interlock_closed) == ("locked", False)
    with pytest.raises(DeviceFault, match="INTERLOCK_OPEN"):
        ready.bridge.gate_on()
    with pytest.raises(DeviceFault, match="INTERLOCK_OPEN"):
        ready.bridge.clear_lockout()
    ready.interlock.closed = True
    with pytest.raises(DeviceFault, match="LASER_LOCKED"):
        ready.bridge.gate_on()
    ready.bridge.clear_lockout()
    ready.bridge.gate_on()


def test_gate_needs_configuration_heartbeat_and_key(bench: Any) -> None:
    bench.bridge.open()
    with pytest.raises(DeviceFault, match="NOT_CONFIGURED"):
        bench.bridge.gate_on()
    bench.bridge.configure(SWEEP)
    with pytest.raises(DeviceFault, match="NO_HEARTBEAT"):
        bench.bridge.gate_on()
    bench.bridge.heartbeat()
    with pytest.raises(Stall):
        bench.bridge.link.control_out(Request.LASER, 1, b"RSAM")
    bench.bridge.gate_on()
    bench.clock.sleep(0.5)
    with pytest.raises(Stall):  # a repeated counter does not feed
        bench.bridge.link.control_out(Request.HEARTBEAT, 0, struct.pack("<I", 1))
    assert bench.bridge.status().watchdog_left_s == pytest.approx(0.5, abs=0.01)


def test_close_shuts_the_gate_and_an_unplugged_device_shuts_it_itself(ready: Any) -> None:
    ready.bridge.close()
    assert not ready.bridge_firmware.gate_open
    ready.bridge.open()
    ready.bridge.configure(SWEEP)
    ready.bridge.heartbeat()
    ready.bridge.gate_on()
    ready.clock.call_at(ready.clock.now() + 0.05, lambda: ready.backend.unplug(ready.bridge_firmware))
    with pytest.raises(LinkLost, match="has gone"):
        ready.bridge.take(5)
    assert not ready.bridge_firmware.gate_open
    ready.backend.plug(ready.bridge_firmware)
    ready.bridge.open()
    assert ready.bridge.status().gate == "off"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"step_ps": 0.5}, "step 0.5 ps is outside 1 to 100 ps"),
        ({"step_ps": 6.75}, "multiple of 0.1 ps"),
        ({"start_ps": 5000.05}, "multiple of 0.1 ps"),
        ({"step_ps": 6.70004}, "femtoseconds"),
        ({"samples": 0}, "samples 0 is outside 1 to 16384"),
        ({"samples": 16_385}, "samples"),
        ({"averages": 257}, "averages 257 is outside 1 to 256"),
        ({"prf_hz": 19_999.0}, "PRF"),
        ({"prf_hz": 80_000.5}, "whole number"),
        ({"start_ps": -1.0}, "start delay"),
        ({"start_ps": 4.0e6}, "last sampling instant"),
        ({"prf_hz": 240_000.0, "start_ps": 3.99e6, "step_ps": 100.0}, "last sampling instant"),
        ({"settle_shots": 70_000}, "settle shots"),
        ({"step_ps": float("nan")}, "step nan"),
    ],
)
def test_setting_out_of_range_is_refused_before_it_is_sent(
    bench_1_0: Any, change: dict[str, float], words: str
) -> None:
    bench_1_0.bridge.open()
    with pytest.raises(LimitError, match=words):
        bench_1_0.bridge.configure(SweepSettings(**{**vars(SWEEP), **change}))
    with pytest.raises(Stall):
        bench_1_0.bridge.link.control_in(Request.GET_CONFIG, 0, 40)


def test_windows_come_on_the_marks_of_the_galvo(bench_1_1: Any) -> None:
    bench = bench_1_1
    bench.helios.open()
    bench.bridge.open()
    bench.helios_firmware.on_marker.append(bench.bridge_firmware.advance)
    assert bench.bridge.supports_windows
    bench.bridge.configure_windows(prf_hz=80_000.0, settle_shots=16, on_advance=True)
    bench.beat()
    bench.bridge.gate_on()
    table = [[Window(4200.0, 6.7, 96, 1), Window(9800.0 + 6.7 * m, 6.7, 96, 2)] for m in range(5)]
    xy = np.repeat([(400 * m, 0) for m in range(5)], 20, axis=0)  # each stop: 10 points to settle, 10 from the mark on
    marked = np.tile(np.arange(20) == 10, 5)
    for run_id in (9, 10):
        records = list(bench.bridge.take_windows(run_id, table, begin=lambda: bench.helios.play(xy, marked, 2000)))
        assert [r.number for r in records] == list(range(5))
        for m, record in enumerate(records):
            assert [w.times_ps[0] for w in record.windows] == pytest.approx([4200.0, 9800.0 + 6.7 * m])
            assert [w.sweeps for w in record.windows] == [1, 2]
            assert record.windows[1].sums[0] == 2 * (3 * m + 1)
    starts = [w.start_s for w in bench.source.wanted[-10::2]]
    assert np.diff(starts) == pytest.approx([0.01] * 4)  # 20 points at 2000 points/s from mark to mark
    second = bench.source.wanted[-9].start_s - starts[0]
    assert second == pytest.approx((16 + 96) / 80_000)
    assert all(w.gate_open for w in bench.source.wanted)
    assert bench.bridge.status().problem == ""


def test_corrupted_line_of_windows_is_taken_again_without_doubles(bench_1_1: Any) -> None:
    bench = bench_1_1
    bench.bridge.open()
    bench.bridge.configure_windows(prf_hz=80_000.0, settle_shots=0)
    faults = iter([False, False, True])
    bench.bridge_firmware.acquirer.queue.fault = lambda frame: None if next(faults, False) else frame
    table = [[Window(4200.0, 6.7, 96, 1)]] * 4
    records = list(bench.bridge.take_windows(3, table))
    assert [r.number for r in records] == [0, 1, 2, 3]
    assert [int(r.windows[0].sums[0]) for r in records] == [0, 3, 6, 9]
    assert bench.bridge.retried == 1
    assert {w.key[1] for w in bench.source.wanted} == {0}


def test_edge_inside_a_record_is_an_error(bench_1_1: Any) -> None:
    bench = bench_1_1
    bench.bridge.open()
    bench.bridge.configure_windows(prf_hz=80_000.0, settle_shots=0, on_advance=True)
    table = [[Window(4200.0, 6.7, 96, 10)]] * 2  # 12 ms a record

    def edges() -> None:
        for delay_s in (0.0, 0.005, 0.02):
            bench.clock.call_at(bench.clock.now() + delay_s, bench.bridge_firmware.advance)

    assert len(list(bench.bridge.take_windows(3, table, begin=edges))) == 2
    assert "ADVANCE_OVERRUN (request 0x00, detail 1)" in bench.bridge.status().problem


def test_windows_out_of_range_are_refused(bench: Any) -> None:
    bench.bridge.open()
    if not bench.bridge.supports_windows:
        with pytest.raises(LimitError, match=r"whole sweeps only"):
            bench.bridge.configure_windows(prf_hz=80_000.0, settle_shots=0)
        return
    bench.bridge.configure_windows(prf_hz=80_000.0, settle_shots=0)
    good = Window(4200.0, 6.7, 96, 1)
    for table, message in (
        ([[good] * 9], "windows in a record 9"),
        ([[good] * 2] * 127, "entries in the window table 254"),
        ([[good], [good, good]], "same number"),
        ([[good], [Window(4200.0, 0.5, 96, 1)]], "record 1, window 0: step 0.5 ps"),
    ):
        with pytest.raises(LimitError, match=message):
            bench.bridge.set_windows(table)
    entries = [[WindowEntry(4_200_000, step_fs, 96, 1)] for step_fs in (6_700, 500)]
    with pytest.raises(Stall):
        bench.bridge.link.control_out(Request.SET_WINDOWS, 0, sbp.encode_windows(entries))
    assert sbp.ErrorEntry.decode(bench.bridge.link.control_in(Request.GET_ERROR, 0, 8)).detail == 1


def test_run_of_the_wrong_kind_is_refused(bench_1_1: Any) -> None:
    bench_1_1.bridge.open()
    with pytest.raises(DeviceFault, match="call configure first"):
        bench_1_1.bridge.take(1)
    bench_1_1.bridge.configure(SWEEP)
    with pytest.raises(DeviceFault, match="call configure_windows first"):
        bench_1_1.bridge.take_windows(1, [[Window(4200.0, 6.7, 96, 1)]])
