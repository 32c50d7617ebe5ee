"""Faults of USB: frames lost, damaged, stale; transfers split or joined; stalls, time-outs, unplugging."""

from __future__ import annotations

from collections.abc import Callable

from picoradar.drivers.bridge import sbp
from picoradar.drivers.bridge.sbp import Request
from picoradar.sim.faults.fault import USB
from picoradar.sim.faults.kind import End, Kind, Site
from picoradar.sim.faults.serial_kinds import flipped
from picoradar.sim.taps import CONTROL_TIMEOUT_S
from picoradar.sim.usb import InTransfer, Setup, SimUsbDevice, errors

HEADER_BYTES = 52


def _frames(mangle: Callable[[Site, bytes], bytes | None]) -> Callable[[Site], None]:
    """Make the installer of a hook that changes frames in the bridge's queue."""

    def install(site: Site) -> None:
        queue = site.bench.bridge.acquirer.queue
        earlier = queue.fault

        def fault(frame: bytes) -> bytes | None:
            queued = frame if earlier is None else earlier(frame)
            return mangle(site, queued) if queued is not None and site.schedule.hits() else queued

        queue.fault = fault

    return install


def _transfers(change: Callable[[Site, bytes], list[InTransfer]]) -> Callable[[Site], None]:
    """Make the installer of a hook that changes the data transfers of the plugged-in device."""

    def install(site: Site) -> None:
        device = _device(site)

        def tamper(endpoint: int, data: bytes) -> list[InTransfer]:
            hit = endpoint == sbp.EP_DATA and site.schedule.hits()
            return change(site, data) if hit else [InTransfer(data)]

        device.tamper = tamper

    return install


def _device(site: Site) -> SimUsbDevice:
    return site.bench.usb_backend.device_of(site.usb)


def _stale() -> Callable[[Site, bytes], bytes]:
    former: list[bytes] = []

    def mangle(_site: Site, frame: bytes) -> bytes:
        former.append(frame)
        return former.pop(0) if len(former) > 1 else frame

    return mangle


def _header_flipped(site: Site, frame: bytes) -> bytes:
    return flipped(site, frame[:HEADER_BYTES]) + frame[HEADER_BYTES:]


def _payload_flipped(site: Site, frame: bytes) -> bytes:
    return frame[:HEADER_BYTES] + flipped(site, frame[HEADER_BYTES:])


def _split(_site: Site, data: bytes) -> list[InTransfer]:
    half = len(data) // 2
    return [InTransfer(data[:half]), InTransfer(data[half:])]


def _requests(act: Callable[[Site, Setup], None]) -> Callable[[Site], None]:
    """Make the installer of a hook that acts before a control request."""

    def install(site: Site) -> None:
        def hook(setup: Setup) -> None:
            if site.schedule.hits():
                act(site, setup)

        site.usb.before.append(hook)

    return install


def _stall(_site: Site, _setup: Setup) -> None:
    raise errors.stalled()


def _time_out(site: Site, _setup: Setup) -> None:
    site.bench.clock.sleep(CONTROL_TIMEOUT_S)
    raise errors.timed_out()


def _fill_error_queue(site: Site, _setup: Setup) -> None:
    for _ in range(40):
        site.bench.bridge.reports.error(sbp.ErrorCode.INTERNAL)


def _halt(site: Site, _setup: Setup) -> None:
    _device(site).halted.add(sbp.EP_DATA)


def _ignore(request: Request, value: int | None = None) -> Callable[[Site], None]:
    """Make the installer of a hook that lets the device ignore one request while it reports success."""

    def install(site: Site) -> None:
        def hook(setup: Setup, _data: bytes) -> bool:
            meant = setup.request == request and (value is None or setup.value == value)
            return meant and site.schedule.hits()

        site.usb.ignored.append(hook)

    return install


def _status_flipped(site: Site) -> None:
    def change(setup: Setup, answer: bytes) -> bytes:
        return flipped(site, answer) if setup.request == Request.GET_STATUS and site.schedule.hits() else answer

    site.usb.answers.append(change)


def _unplug(site: Site) -> End:
    tap, backend = site.usb, site.bench.usb_backend
    backend.unplug(tap)
    return lambda: _plug(site)


def _plug(site: Site) -> None:
    """Plug the cable in, at a new address, unless it is plugged in already."""
    backend = site.bench.usb_backend
    if all(device.firmware is not site.usb for device in backend.enumerate_devices()):
        backend.plug(site.usb)


def _silence(site: Site) -> End:
    tap = site.usb
    tap.silent = True

    def speak() -> None:
        tap.silent = False

    return speak


USB_KINDS: dict[str, Kind] = {
    "frame_lost": Kind(("bridge",), "a frame is lost: a gap in the sequence numbers", _frames(lambda _s, _f: None)),
    "frame_payload_flipped": Kind(("bridge",), "one bit of a frame's samples is wrong", _frames(_payload_flipped)),
    "frame_header_flipped": Kind(("bridge",), "one bit of a frame's header is wrong", _frames(_header_flipped)),
    "frame_stale": Kind(("bridge",), "a frame of an earlier run comes", _frames(_stale())),
    "frame_truncated": Kind(("bridge",), "a transfer ends too early", _frames(lambda _s, f: f[: len(f) // 2])),
    "transfer_split": Kind(("bridge",), "a frame comes in two transfers", _transfers(_split)),
    "transfer_doubled": Kind(("bridge",), "a transfer comes twice", _transfers(lambda _s, d: [InTransfer(d)] * 2)),
    "transfer_unended": Kind(
        ("bridge",),
        "the packet that ends a transfer is missing",
        _transfers(lambda _s, d: [InTransfer(d, ended=False)]),
    ),
    "transfer_overlong": Kind(
        ("bridge",), "more bytes than the host has room for", _transfers(lambda _s, d: [InTransfer(d * 3)])
    ),
    "transfer_lost": Kind(("bridge",), "a transfer never arrives", _transfers(lambda _s, _d: [])),
    "endpoint_halted": Kind(("bridge",), "the data endpoint stalls until it is cleared", _requests(_halt)),
    "request_stalled": Kind(USB, "a control request is refused without reason", _requests(_stall)),
    "request_timed_out": Kind(USB, "a control request gets no answer", _requests(_time_out)),
    "status_flipped": Kind(("bridge",), "one bit of the status block is wrong", _status_flipped),
    "error_queue_full": Kind(("bridge",), "the error queue overflows", _requests(_fill_error_queue)),
    "heartbeat_lost": Kind(("bridge",), "heartbeats do not reach the bridge", _ignore(Request.HEARTBEAT)),
    "gate_off_ignored": Kind(("bridge",), "the gate does not close on command", _ignore(Request.LASER, 0)),
    "start_ignored": Kind(("bridge",), "a run does not start", _ignore(Request.START)),
    "usb_unplugged": Kind(
        USB, "the cable is pulled (and plugged in again at a new address, if it lasts)", begin=_unplug
    ),
    "usb_silent": Kind(USB, "the device answers nothing", begin=_silence),
}
