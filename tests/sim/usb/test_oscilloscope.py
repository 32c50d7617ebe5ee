"""Oscilloscope: driver and instrument over USBTMC on the simulated bus."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.errors import DeviceFault, LimitError, ProtocolError, Stall, Timeout
from picoradar.drivers.interfaces import SweepSettings
from picoradar.drivers.links import ControlRequest, Header, MsgId, UsbLink, Usbtmc
from picoradar.drivers.links import usbtmc_wire as wire
from picoradar.drivers.oscilloscope import Oscilloscope, oscilloscope_link
from picoradar.drivers.oscilloscope.waveform import decode_block
from picoradar.sim.firmware.oscilloscope import OscilloscopeFirmware
from picoradar.sim.usb import InTransfer, SimUsbBackend
from picoradar.sim.wires import Acquisition, TriggerLine

SWEEP = SweepSettings(start_ps=2000.0, step_ps=6.7, samples=1430, averages=16, settle_shots=0, prf_hz=80_000.0)
OUT, IN, INTERRUPT = 0x02, 0x81, 0x83
GOLDEN = {
    k: bytes.fromhex(v)
    for k, v in tomllib.loads((Path(__file__).parents[2] / "golden" / "usbtmc.toml").read_text()).items()
}


class Bump:
    """A pulse on a flat line, in the codes of the bridge."""

    clipped = False

    def __init__(self) -> None:
        self.wanted: list[Acquisition] = []
        self.top = 200

    def acquire(self, wanted: Acquisition) -> Any:
        self.wanted.append(wanted)
        codes = np.full(wanted.samples, 32, np.uint32)
        codes[wanted.samples // 2] = self.top
        return codes * wanted.sweeps


class ScopeBench:
    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.trigger = TriggerLine(80_000.0)
        self.source = Bump()
        self.firmware = OscilloscopeFirmware(self.clock, self.trigger, self.source)
        self.backend = SimUsbBackend(self.clock, [self.firmware])
        self.link: UsbLink = oscilloscope_link(self.clock, backend=self.backend)
        self.tmc = Usbtmc(self.link, interrupt_in=INTERRUPT)
        self.scope = Oscilloscope(self.tmc)

    def ask(self, query: str) -> str:
        return self.tmc.query(query.encode() + b"\n").decode().strip()


@pytest.fixture
def bench() -> ScopeBench:
    return ScopeBench()


@pytest.fixture
def opened(bench: ScopeBench) -> ScopeBench:
    bench.scope.open()
    return bench


def test_worked_bytes_over_the_bus(bench: ScopeBench) -> None:
    bench.link.open()
    bench.link.write(OUT, GOLDEN["idn_lf"], timeout_s=0.1)
    bench.link.write(OUT, GOLDEN["request"], timeout_s=0.1)
    answer = bench.link.read(IN, 2048, timeout_s=0.1)
    assert answer[:4] == GOLDEN["answer"][:4]
    assert wire.decode_answer(answer, 2) == (b"picoradar,SLR sampling oscilloscope,SO-0001,1.0\n", True)
    assert bench.link.control_in(7, 0, 24, kind=0xA1) == GOLDEN["capabilities"]


def test_identity_and_averaged_waveform(opened: ScopeBench) -> None:
    scope = opened.scope
    assert str(scope.identify()) == "picoradar SLR sampling oscilloscope, s/n SO-0001, 1.0"
    scope.configure(SWEEP)
    begin = opened.clock.now()
    records = scope.take(5, 2)
    assert opened.clock.now() - begin == pytest.approx(2 * 16 * 1430 / 20_000, rel=0.01)
    assert [r.number for r in records] == [0, 1]
    for record in records:
        assert record.run_id == 5
        assert record.times_ps[[0, -1]] == pytest.approx([2000.0, 2000.0 + 6.7 * 1429])
        assert record.trace_mv[0] == pytest.approx(0.0, abs=0.003)
        assert record.trace_mv[715] == pytest.approx(84.0, abs=0.003)
        assert not record.clipped
    wanted = opened.source.wanted
    assert [w.key for w in wanted] == [(0, 0, 0, 0), (0, 1, 0, 0)]
    assert (wanted[0].prf_hz, wanted[0].sweeps) == (20_000.0, 16)
    assert wanted[0].delay_ps == pytest.approx(2000.0)
    scope.close()


def test_clipping_is_flagged(opened: ScopeBench) -> None:
    opened.source.top = 255
    opened.scope.configure(SWEEP)
    (record,) = opened.scope.take(1)
    assert record.clipped
    assert record.trace_mv[715] == max(record.trace_mv)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"averages": 0}, "averages"),
        ({"samples": 262_145}, "samples"),
        ({"settle_shots": 16}, "set 0"),
        ({"prf_hz": 0.0}, "PRF"),
        ({"step_ps": 0.01}, "step"),
        ({"start_ps": float("nan")}, "start delay"),
    ],
)
def test_setting_out_of_range_is_refused(opened: ScopeBench, change: dict[str, float], message: str) -> None:
    with pytest.raises(LimitError, match=message):
        opened.scope.configure(SweepSettings(**{**vars(SWEEP), **change}))
    with pytest.raises(DeviceFault, match="call configure first"):
        opened.scope.take(1)


def test_without_triggers_it_is_a_timeout_and_the_next_waveform_comes(opened: ScopeBench) -> None:
    opened.scope.configure(SWEEP)
    opened.trigger.rate_hz = 0.0
    with pytest.raises(Timeout, match="check that the triggers run"):
        opened.scope.take(1)
    opened.trigger.rate_hz = 20_000.0
    assert len(opened.scope.take(2)) == 1


def test_gate_is_that_of_the_bridge(opened: ScopeBench) -> None:
    with pytest.raises(DeviceFault, match="no gate"):
        opened.scope.gate_on()
    opened.scope.gate_off()
    opened.scope.heartbeat()
    status = opened.scope.status()
    assert (status.gate, status.problem) == ("off", "no trigger gate")


def test_without_the_abort_sequence_everything_times_out(bench: ScopeBench) -> None:
    bench.tmc.open()
    bench.link.write(OUT, wire.encode_request(200, 1024), timeout_s=0.1)
    with pytest.raises(Timeout):
        bench.link.read(IN, 2048, timeout_s=0.1)
    with pytest.raises(Timeout):
        bench.link.write(OUT, wire.encode_message(201, b"*IDN?\n"), timeout_s=0.1)
    abort = bench.link.control_in(ControlRequest.INITIATE_ABORT_BULK_IN, 200, 2, kind=0xA2, index=IN)
    assert abort == bytes([1, 200])
    check: Callable[[], bytes] = lambda: bench.link.control_in(4, 0, 8, kind=0xA2, index=IN)  # noqa: E731
    assert check()[0] == wire.TmcStatus.PENDING
    assert bench.link.read(IN, 2048, timeout_s=0.1) == b""
    assert check()[0] == wire.TmcStatus.SUCCESS
    assert bench.ask("*OPC?") == "1"


def test_host_that_does_not_read_bulk_in_dry_is_not_held_up(bench: ScopeBench) -> None:
    bench.tmc.open()
    bench.link.write(OUT, wire.encode_request(200, 1024), timeout_s=0.1)
    with pytest.raises(Timeout):
        bench.link.read(IN, 2048, timeout_s=0.1)
    bench.link.control_in(ControlRequest.INITIATE_ABORT_BULK_IN, 200, 2, kind=0xA2, index=IN)
    checks = [bench.link.control_in(4, 0, 8, kind=0xA2, index=IN)[0] for _ in range(2)]
    assert checks == [wire.TmcStatus.PENDING, wire.TmcStatus.SUCCESS]
    assert bench.ask("*OPC?") == "1"


def test_driver_aborts_after_a_timeout(bench: ScopeBench) -> None:
    bench.tmc.open()
    with pytest.raises(Timeout):
        bench.tmc.read(timeout_s=0.2)
    assert bench.ask("*OPC?") == "1"
    assert bench.ask("*STB?") == "0"


def test_read_status_byte_comes_on_the_interrupt_endpoint(opened: ScopeBench) -> None:
    assert opened.tmc.status_byte() == 0
    opened.tmc.write(b"*IDN?\n")
    assert opened.tmc.status_byte() == 0x10
    opened.tmc.read()
    opened.tmc.write(b"*SRE 16;*IDN?\n")
    assert opened.link.read(INTERRUPT, 2, timeout_s=0.5) == b"\x81\x50"
    opened.tmc.read()


def test_new_command_drops_the_answer_that_waits(opened: ScopeBench) -> None:
    opened.tmc.write(b"*IDN?\n")
    opened.tmc.write(b"*OPC?\n")
    assert opened.tmc.read() == b"1\n"
    assert opened.ask(":SYST:ERR?") == '-410,"Query INTERRUPTED"'
    assert opened.ask("*ESR?") == "4"


def test_long_answers_come_in_the_parts_that_are_asked_for(opened: ScopeBench) -> None:
    opened.scope.configure(SWEEP)
    opened.scope.take(1)
    opened.tmc.write(b":WAVeform:DATA?\n")
    parts = []
    for tag in (100, 101, 102):
        opened.link.write(OUT, wire.encode_request(tag, 1000), timeout_s=0.1)
        parts.append(wire.decode_answer(opened.link.read(IN, 2048, timeout_s=0.1), tag))
    assert [(len(data), ended) for data, ended in parts] == [(1000, False), (1000, False), (867, True)]
    assert b"".join(data for data, _ in parts).startswith(b"#42860")


def test_command_in_several_transfers_is_gathered(opened: ScopeBench) -> None:
    for tag, piece, end in ((100, b"*I", False), (101, b"DN", False), (102, b"?\n", True)):
        opened.link.write(OUT, wire.encode_message(tag, piece, end=end), timeout_s=0.1)
    assert opened.tmc.read().startswith(b"picoradar")


def test_term_char_ends_an_answer(opened: ScopeBench) -> None:
    opened.tmc.write(b"*IDN?\n")
    opened.link.write(OUT, Header(MsgId.DEV_DEP_MSG_IN, 99, 1024, 2, ord(",")).encode(), timeout_s=0.1)
    assert Header.decode(opened.link.read(IN, 2048, timeout_s=0.1)).attributes == 2
    assert opened.tmc.read() == b"SLR sampling oscilloscope,SO-0001,1.0\n"


@pytest.mark.parametrize(
    "transfer",
    [b"\x01\x01\x01\x00" + bytes(8), b"\x09\x01\xfe\x00" + bytes(8), b"short", GOLDEN["idn"][:14],
     Header(MsgId.DEV_DEP_MSG_IN, 7, 0).encode()],
)  # fmt: skip
def test_bad_header_halts_bulk_out(opened: ScopeBench, transfer: bytes) -> None:
    with pytest.raises(Stall):
        opened.link.write(OUT, transfer, timeout_s=0.1)
    with pytest.raises(Stall):
        opened.link.write(OUT, GOLDEN["idn"], timeout_s=0.1)
    opened.link.clear_halt(OUT)
    assert opened.ask("*OPC?") == "1"


def test_answer_to_another_request_is_refused_and_cleared(opened: ScopeBench) -> None:
    device = opened.backend.device_of(opened.firmware)
    device.tamper = lambda endpoint, data: [InTransfer(data[:1] + bytes([data[1] ^ 3, data[2] ^ 3]) + data[3:])]
    with pytest.raises(ProtocolError, match="was expected"):
        opened.ask("*IDN?")
    device.tamper = None
    assert opened.ask("*OPC?") == "1"


def test_opening_habits_of_other_clients(bench: ScopeBench) -> None:
    bench.link.open()
    assert bench.link.control_in(ControlRequest.REN_CONTROL, 1, 1, kind=0xA1) == b"\x01"
    assert bench.link.control_in(ControlRequest.INITIATE_CLEAR, 0, 1, kind=0xA1) == b"\x01"
    assert bench.link.control_in(ControlRequest.CHECK_CLEAR_STATUS, 0, 2, kind=0xA1) == b"\x01\x00"
    bench.link.clear_halt(OUT)
    assert bench.link.control_in(ControlRequest.GET_CAPABILITIES, 0, 24, kind=0xA1) == GOLDEN["capabilities"]
    bench.link.write(OUT, wire.encode_message(1, b"*IDN?\n"), timeout_s=0.1)
    bench.link.write(OUT, wire.encode_request(2, 1 << 20), timeout_s=0.1)
    assert b"picoradar" in bench.link.read(IN, (1 << 20) + 512, timeout_s=0.1)
    with pytest.raises(Stall):
        bench.link.control_in(99, 0, 1, kind=0xA1)


def test_scpi_forms_headers_and_errors(opened: ScopeBench) -> None:
    opened.tmc.write(b":system:header on\n")
    assert opened.ask(":acq:coun?") == ":ACQUIRE:COUNT 1.600000000E+01"
    opened.tmc.write(b":SYST:HEAD OFF\n")
    assert opened.ask(":ACQuire:COUNt 8;POINts 100;COUNt?;POINts?") == "8.000000000E+00;1.000000000E+02"
    for command, number in (
        (":NONSense 1", "-113"),
        (":ACQuire:COUNt", "-109"),
        (":ACQuire:COUNt 1,2", "-108"),
        (":ACQuire:COUNt x", "-104"),
        (":ACQuire:COUNt 0", "-222"),
        (":WAVeform:FORMat HEX", "-224"),
        (":WAVeform:DATA?", "-230"),
    ):
        opened.tmc.write(command.encode())
        assert opened.ask(":SYSTem:ERRor?").startswith(number)
    assert opened.ask(":SYSTem:ERRor?") == '0,"No error"'


@pytest.mark.parametrize("form", ["BYTE", "WORD", "LONG", "ASCii"])
def test_every_format_tells_the_same_voltages(opened: ScopeBench, form: str) -> None:
    opened.scope.configure(SWEEP)
    opened.scope.take(1)
    opened.tmc.write(f":WAVeform:FORMat {form};BYTeorder MSBFirst\n".encode())
    fields = [float(f) for f in opened.ask(":WAVeform:PREamble?").split(",")[:10]]
    raw = opened.tmc.query(b":WAVeform:DATA?\n")
    if form == "ASCii":
        volts = np.array([float(v) for v in raw.decode().split(",")])
    else:
        codes = np.frombuffer(decode_block(raw), {"BYTE": "i1", "WORD": ">i2", "LONG": ">i4"}[form])
        volts = codes * fields[7] + fields[8]
    step_v = fields[7] if form == "BYTE" else 1e-5
    assert volts[[0, 715]] == pytest.approx([0.0, 0.084], abs=step_v)
    assert fields[:4] == [{"ASCii": 0, "BYTE": 1, "WORD": 2, "LONG": 3}[form], 2, 1430, 16]


def test_trigger_message_takes_a_waveform(opened: ScopeBench) -> None:
    opened.scope.configure(SWEEP)
    opened.tmc.trigger()
    assert opened.tmc.query(b"*OPC?;:WAVeform:POINts?\n", timeout_s=5.0) == b"1;1430\n"
