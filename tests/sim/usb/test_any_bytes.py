"""Any bytes at all: firmwares refuse what they do not know, and go on."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from picoradar.drivers.bridge import sbp
from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.helios import wire as helios_wire
from picoradar.drivers.links import usbtmc_wire
from picoradar.sim.firmware.oscilloscope import OscilloscopeFirmware
from picoradar.sim.usb import Setup, UsbStall
from picoradar.sim.wires import TriggerLine

SETUPS = st.builds(
    Setup,
    st.sampled_from([0xC1, 0x41, 0xA1, 0xA2, 0x40]),
    st.one_of(st.integers(0, 255), st.sampled_from(list(sbp.Request))),
    st.one_of(st.integers(0, 3), st.integers(0, 0xFFFF)),
    st.integers(0, 1),
    st.integers(0, 300),
)
BLOCKS = st.one_of(
    st.binary(max_size=60),
    st.just(b"RSAL"),
    st.just(sbp.Configuration(5_000_000, 6_700, 100, 8, sbp.ConfigFlag(1), 1, 80_000).encode()),
    st.just(sbp.encode_windows([[sbp.WindowEntry(4_200_000, 6_700, 96, 1)]])),
)


@given(requests=st.lists(st.tuples(SETUPS, BLOCKS), max_size=25))
@settings(deadline=None, max_examples=60)
def test_bridge_stands_any_requests(make_bench: Any, requests: list[tuple[Setup, bytes]]) -> None:
    bench = make_bench(sbp.VERSION_1_1)
    firmware = bench.bridge_firmware
    for setup, data in requests:
        with contextlib.suppress(UsbStall):
            assert len(firmware.control(setup, data)) <= 72
        bench.clock.sleep(0.003)
        # The gate is never on without a live watchdog, a configuration and the interlock.
        if firmware.gate_open:
            status = firmware.status()
            assert status.watchdog_ms > 0
            assert status.flags & sbp.StatusFlag.CONFIGURED
    firmware.bus_reset()
    bench.bridge.open()
    assert bench.bridge.status().gate in ("off", "locked")
    bench.bridge.close()


COMMANDS = st.binary(max_size=32).filter(lambda data: data[:1] != b"\xde")


@given(transfers=st.lists(st.tuples(st.booleans(), COMMANDS, st.binary(max_size=70)), max_size=20))
@example(transfers=[(True, b"", bytes(7) + b"\x00\x00\x01\x00\x00")])  # a rate of 0, repeated for ever
@settings(deadline=None, max_examples=60)
def test_galvo_stands_any_bytes(make_bench: Any, transfers: list[tuple[bool, bytes, bytes]]) -> None:
    bench = make_bench(sbp.VERSION_1_0)
    firmware = bench.helios_firmware
    firmware.alternate_selected(0, 1)
    for is_frame, command, frame in transfers:
        if is_frame:
            firmware.receive(helios_wire.EP_FRAME, frame)
        else:
            firmware.receive(helios_wire.EP_COMMAND, command)
        bench.clock.sleep(0.01)
        answer = firmware.take(helios_wire.EP_ANSWER)
        assert answer is None or answer[0] in (0x83, 0x84, 0x85)
    assert all(-1 <= x < 1 and -1 <= y < 1 for _, x, y in bench.mirrors.seen)


class Flat:
    clipped = False

    def acquire(self, wanted: Any) -> Any:
        return np.full(wanted.samples, 32 * wanted.sweeps, np.uint32)


WORDS = st.sampled_from(
    [
        b":WAV:DATA?", b":DIG CHAN1", b"*IDN?", b"*RST", b":ACQ:COUN ", b":ACQ:POIN ", b";", b"\n", b"nan", b"1E400",
        b"-1", b",", b":", b"?", b"*OPC?", b":SYST:ERR?", b"#0", b" ", b"8",
    ]
)  # fmt: skip


@given(
    messages=st.lists(
        st.one_of(
            st.lists(WORDS, max_size=6).map(lambda words: usbtmc_wire.encode_message(1, b"".join(words))),
            st.builds(usbtmc_wire.encode_request, st.integers(1, 255), st.integers(0, 5000)),
            st.binary(max_size=30),
        ),
        max_size=15,
    )
)
@settings(deadline=None, max_examples=80)
def test_oscilloscope_stands_any_messages(messages: list[bytes]) -> None:
    clock = VirtualClock()
    firmware = OscilloscopeFirmware(clock, TriggerLine(20_000.0), Flat())
    for message in messages:
        with contextlib.suppress(UsbStall):
            firmware.receive(0x02, message)
        clock.sleep(0.05)
        firmware.take(0x81)
    firmware.bus_reset()
    clock.sleep(60.0)
    assert firmware.receive(0x02, usbtmc_wire.encode_message(1, b"*RST;*OPC?"))
    assert firmware.receive(0x02, usbtmc_wire.encode_request(2, 100))
    answer = firmware.take(0x81)
    assert answer is not None
    assert usbtmc_wire.decode_answer(answer, 2) == (b"1\n", True)
