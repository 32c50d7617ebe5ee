"""Faults of a serial line: bytes lost, damaged, late, doubled, merged; cables pulled; the wrong device answering."""

from __future__ import annotations

from collections.abc import Callable

from picoradar.sim.faults.fault import SERIAL
from picoradar.sim.faults.kind import End, Kind, Site
from picoradar.sim.taps import Pieces

Mangle = Callable[[Site, bytes, float], Pieces]


def _replies(mangle: Mangle) -> Callable[[Site], None]:
    """Make the installer of a hook that changes answers on their way to the host."""

    def install(site: Site) -> None:
        def hook(data: bytes, delay_s: float) -> Pieces:
            return mangle(site, data, delay_s) if site.schedule.hits() else [(data, delay_s)]

        site.serial.to_host.append(hook)

    return install


def _commands(mangle: Callable[[Site, bytes], bytes]) -> Callable[[Site], None]:
    """Make the installer of a hook that changes commands on their way to the device."""

    def install(site: Site) -> None:
        site.serial.to_device.append(lambda data: mangle(site, data) if site.schedule.hits() else data)

    return install


def _place(site: Site, data: bytes) -> int:
    return int(site.rng.integers(len(data)))


def flipped(site: Site, data: bytes) -> bytes:
    """Turn one bit of the bytes over."""
    at = _place(site, data)
    return data[:at] + bytes([data[at] ^ 1 << int(site.rng.integers(7))]) + data[at + 1 :]


def _dropped(site: Site, data: bytes, delay_s: float) -> Pieces:
    at = _place(site, data)
    return [(data[:at] + data[at + 1 :], delay_s)]


def _doubled(site: Site, data: bytes, delay_s: float) -> Pieces:
    at = _place(site, data)
    return [(data[: at + 1] + data[at:], delay_s)]


def _inserted(site: Site, data: bytes, delay_s: float) -> Pieces:
    at = _place(site, data)
    return [(data[:at] + bytes([int(site.rng.integers(256))]) + data[at:], delay_s)]


def _split(site: Site, data: bytes, delay_s: float) -> Pieces:
    at = _place(site, data)
    return [(data[:at], delay_s), (data[at:], delay_s + site.parameters["gap_s"])]


def _garbage(site: Site, data: bytes, delay_s: float) -> Pieces:
    return [(site.rng.integers(128, 256, len(data), dtype="uint8").tobytes(), delay_s)]


def _merge(site: Site) -> None:
    held: list[bytes] = []

    def hook(data: bytes, delay_s: float) -> Pieces:
        if site.schedule.hits():
            held.append(data)
            return []
        joined = b"".join([*held, data])
        held.clear()
        return [(joined, delay_s)]

    site.serial.to_host.append(hook)


def _echo(site: Site) -> None:
    def hook(data: bytes) -> bytes:
        if site.schedule.hits():
            site.serial.say(data)
        return data

    site.serial.to_device.append(hook)


def _unplug(site: Site) -> End:
    wire = site.bench.wires[site.fault.link]
    wire.plugged = False

    def plug_in() -> None:
        wire.plugged = True

    return plug_in


def _silence(site: Site) -> End:
    tap = site.serial

    def nothing(_data: bytes, _delay_s: float) -> Pieces:
        return []

    tap.to_host.append(nothing)
    return lambda: tap.to_host.remove(nothing)


def _dead(site: Site) -> End:
    tap = site.serial

    def nothing(_data: bytes) -> bytes:
        return b""

    tap.to_device.append(nothing)
    return lambda: tap.to_device.remove(nothing)


def _replied(data: bytes) -> Callable[[Site], None]:
    return _replies(lambda _site, _data, delay_s: [(data, delay_s)])


SERIAL_KINDS: dict[str, Kind] = {
    "reply_lost": Kind(SERIAL, "an answer does not come", _replies(lambda _s, _d, _t: [])),
    "reply_bit_flipped": Kind(SERIAL, "one bit of an answer is wrong", _replies(lambda s, d, t: [(flipped(s, d), t)])),
    "reply_byte_dropped": Kind(SERIAL, "one byte of an answer is missing", _replies(_dropped)),
    "reply_byte_doubled": Kind(SERIAL, "one byte of an answer comes twice", _replies(_doubled)),
    "reply_byte_inserted": Kind(SERIAL, "a byte too many in an answer", _replies(_inserted)),
    "reply_split": Kind(SERIAL, "an answer comes in two pieces", _replies(_split), defaults={"gap_s": 0.02}),
    "reply_late": Kind(
        SERIAL, "an answer comes after the host has given up, into the next question",
        _replies(lambda s, d, t: [(d, t + s.parameters["delay_s"])]), defaults={"delay_s": 1.2},
    ),
    "reply_unterminated": Kind(SERIAL, "the end of line is missing", _replies(lambda _s, d, t: [(d[:-1], t)])),
    "reply_doubled": Kind(SERIAL, "an answer comes twice", _replies(lambda _s, d, t: [(d, t), (d, t)])),
    "reply_garbage": Kind(SERIAL, "noise in place of an answer, as with a wrong baud rate", _replies(_garbage)),
    "replies_merged": Kind(SERIAL, "an answer waits for the next one", _merge),
    "line_chatter": Kind(
        SERIAL, "noise after an answer",
        _replies(lambda s, d, t: [(d, t), (s.rng.integers(33, 127, 24, dtype="uint8").tobytes(), t + 0.01)]),
    ),
    "echo": Kind(SERIAL, "the line sends back what the host says", _echo),
    "refused": Kind(SERIAL, "a command is refused without reason", _replied(b"E07\r")),
    "other_device": Kind(SERIAL, "something else answers on the port", _replied(b"ACME,MODEL 1,0,1.0\r\n")),
    "command_lost": Kind(SERIAL, "the device does not hear a command", _commands(lambda _s, _d: b"")),
    "command_bit_flipped": Kind(SERIAL, "the device hears one bit wrong", _commands(flipped)),
    "unplugged": Kind(SERIAL, "the cable is pulled (and plugged in again, if it lasts)", begin=_unplug),
    "silent": Kind(SERIAL, "the device hears everything and answers nothing", begin=_silence),
    "deaf": Kind(SERIAL, "the device hears nothing", begin=_dead),
}  # fmt: skip
