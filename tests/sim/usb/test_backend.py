"""pyusb's own code over the simulated bus: walk, strings, errors, time."""

from __future__ import annotations

import errno
from array import array
from typing import Any

import pytest
import usb.backend
import usb.core
import usb.util

from picoradar.drivers.bridge import sbp
from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.errors import LinkLost, ProtocolError, Stall, Timeout
from picoradar.drivers.links import UsbIdentity, UsbLink
from picoradar.sim.usb import (
    BULK,
    Configuration,
    Device,
    Endpoint,
    Interface,
    InTransfer,
    Setup,
    SimUsbBackend,
    UsbStall,
)


class Pipe:
    """A device with one pair of bulk endpoints, which does what the test says."""

    descriptors = Device(
        0x1234,
        0x5678,
        0x0100,
        (Configuration((Interface((Endpoint(0x01, BULK, 512), Endpoint(0x81, BULK, 512))),)),),
        strings=("maker", "pipe", "S-1"),
        iManufacturer=1,
        iProduct=2,
        iSerialNumber=3,
    )

    def __init__(self) -> None:
        self.received: list[bytes] = []
        self.to_send: list[bytes] = []
        self.busy = False
        self.halt = False
        self.resets = 0

    def control(self, setup: Setup, data: bytes) -> bytes:
        if setup.request == 0xEE:
            raise UsbStall("refused")
        return bytes([setup.request]) * setup.length

    def receive(self, endpoint: int, data: bytes) -> bool:
        if self.halt:
            raise UsbStall("halted")
        if not self.busy:
            self.received.append(data)
        return not self.busy

    def take(self, endpoint: int) -> bytes | None:
        if self.halt:
            raise UsbStall("halted")
        return self.to_send.pop(0) if self.to_send else None

    def configured(self, value: int) -> None:
        pass

    def alternate_selected(self, interface: int, alternate: int) -> None:
        pass

    def halt_cleared(self, endpoint: int) -> None:
        self.halt = False

    def bus_reset(self) -> None:
        self.resets += 1


@pytest.fixture
def pipe() -> Pipe:
    return Pipe()


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


@pytest.fixture
def backend(clock: VirtualClock, pipe: Pipe) -> SimUsbBackend:
    return SimUsbBackend(clock, [pipe])


@pytest.fixture
def link(clock: VirtualClock, backend: SimUsbBackend) -> UsbLink:
    made = UsbLink(UsbIdentity(0x1234, 0x5678), clock, device="pipe", backend=backend)
    made.open()
    return made


def _found(backend: SimUsbBackend) -> Any:
    device = usb.core.find(backend=backend)
    assert device is not None
    return device


def test_all_methods_of_the_interface_are_there() -> None:
    for name in vars(usb.backend.IBackend):
        if not name.startswith("_"):
            assert getattr(SimUsbBackend, name) is not getattr(usb.backend.IBackend, name), name


def test_walk_over_all_devices_ends_and_is_complete(bench: Any) -> None:
    tree = [
        (
            device.idProduct,
            configuration.bConfigurationValue,
            interface.bAlternateSetting,
            [(e.bEndpointAddress, e.bmAttributes, e.wMaxPacketSize, e.bInterval) for e in interface],
        )
        for device in usb.core.find(find_all=True, backend=bench.backend)
        for configuration in device
        for interface in configuration
    ]
    helios = [(0x02, 2, 64, 0), (0x81, 2, 64, 0), (0x06, 3, 32, 1), (0x83, 3, 32, 1), (0x84, 1, 1, 1), (0x05, 1, 1, 1)]
    assert tree == [
        (0xE500, 1, 0, []),
        (0xE500, 1, 1, helios),
        (0x0001, 1, 0, [(0x81, 2, 512, 0), (0x82, 3, 16, 6)]),
    ]
    for device in usb.core.find(find_all=True, backend=bench.backend):
        assert str(device)  # pyusb prints the whole tree with its strings


def test_strings_come_by_control_transfer(bench: Any) -> None:
    helios = usb.core.find(backend=bench.backend, idProduct=0xE500)
    assert (helios.manufacturer, helios.product, helios.serial_number) == ("Gitle Mikkelsen", "Helios Laser DAC", None)
    assert (helios.bMaxPacketSize0, helios.bcdDevice, helios.speed) == (8, 0x0200, usb.util.SPEED_FULL)
    bridge = usb.core.find(backend=bench.backend, idProduct=sbp.PRODUCT_ID)
    assert bridge.serial_number == "SB-0001"


@pytest.mark.parametrize("indices", [(1, 0, 0), (0, 2, 0), (0, 0, 1)])
def test_unknown_descriptor_is_an_index_error(bench: Any, indices: tuple[int, int, int]) -> None:
    interface, alternate, configuration = indices
    helios = bench.backend.device_of(bench.helios_firmware)
    with pytest.raises(IndexError):
        bench.backend.get_interface_descriptor(helios, interface, alternate, configuration)


def test_raw_descriptors_say_what_the_walk_says(backend: SimUsbBackend) -> None:
    device = _found(backend)
    raw = bytes(device.ctrl_transfer(0x80, 6, 0x0200, 0, 255))
    assert int.from_bytes(raw[2:4], "little") == len(raw) == 9 + 9 + 2 * 7
    assert bytes(device.ctrl_transfer(0x80, 6, 0x0100, 0, 18))[8:12] == bytes.fromhex("34 12 78 56")
    with pytest.raises(usb.core.USBError) as caught:
        device.ctrl_transfer(0x80, 6, 0x0309, 0, 255)
    assert caught.value.errno == errno.EPIPE


def test_unknown_alternate_setting_is_refused(backend: SimUsbBackend) -> None:
    device = _found(backend)
    with pytest.raises(ValueError, match="No matching interface"):
        device.set_interface_altsetting(0, 1)
    handle = backend.open_device(backend.enumerate_devices()[0])
    with pytest.raises(usb.core.USBError) as caught:
        backend.set_interface_altsetting(handle, 0, 1)
    assert caught.value.errno == errno.ENOENT


def test_unconfigured_device_has_no_endpoints(backend: SimUsbBackend, link: UsbLink) -> None:
    device = _found(backend)
    device.set_configuration(0)
    assert bytes(device.ctrl_transfer(0x80, 8, 0, 0, 1)) == b"\0"
    with pytest.raises(LinkLost, match="endpoint"):
        link.read(0x81, 512, timeout_s=0.1)
    device.set_configuration(1)
    usb.util.dispose_resources(device)


def test_claim_is_for_one_handle(backend: SimUsbBackend, link: UsbLink, clock: VirtualClock) -> None:
    other = UsbLink(UsbIdentity(0x1234, 0x5678), clock, device="pipe", backend=backend)
    with pytest.raises(LinkLost, match="in use by another program"):
        other.open()
    link.close()
    other.open()
    other.close()


def test_time_limit_after_part_of_the_data_gives_the_part(
    backend: SimUsbBackend, pipe: Pipe, link: UsbLink, clock: VirtualClock
) -> None:
    device = backend.device_of(pipe)
    device.tamper = lambda endpoint, data: [InTransfer(data, ended=False)]  # its zero-length packet is left out
    pipe.to_send.append(bytes(512))
    begin = clock.now()
    assert link.read(0x81, 1024, timeout_s=0.05) == bytes(512)
    assert 0.05 <= clock.now() - begin < 0.051
    with pytest.raises(Timeout):
        link.read(0x81, 1024, timeout_s=0.05)


def test_zero_length_packet_ends_a_transfer_of_whole_packets(pipe: Pipe, link: UsbLink) -> None:
    pipe.to_send += [bytes(512), b"next"]
    assert link.read(0x81, 1024, timeout_s=0.1) == bytes(512)
    assert link.read(0x81, 1024, timeout_s=0.1) == b"next"
    pipe.to_send += [bytes(512), b"next"]
    assert [link.read(0x81, 512, timeout_s=0.1) for _ in range(3)] == [bytes(512), b"", b"next"]


def test_long_transfer_is_read_in_parts_and_a_small_buffer_overflows(pipe: Pipe, link: UsbLink) -> None:
    pipe.to_send.append(bytes(range(256)) * 5)
    parts = [link.read(0x81, 512, timeout_s=0.1) for _ in range(3)]
    assert [len(p) for p in parts] == [512, 512, 256]
    assert b"".join(parts) == bytes(range(256)) * 5
    pipe.to_send.append(bytes(300))
    with pytest.raises(ProtocolError, match="Overflow"):
        link.read(0x81, 100, timeout_s=0.1)


def test_stall_lasts_until_clear_halt(pipe: Pipe, link: UsbLink) -> None:
    pipe.halt = True
    with pytest.raises(Stall):
        link.read(0x81, 512, timeout_s=0.1)
    pipe.halt = False
    with pytest.raises(Stall):
        link.read(0x81, 512, timeout_s=0.1)
    link.clear_halt(0x81)
    pipe.to_send.append(b"again")
    assert link.read(0x81, 512, timeout_s=0.1) == b"again"


def test_refused_request_stalls_once(link: UsbLink) -> None:
    with pytest.raises(Stall):
        link.control_in(0xEE, 0, 4)
    assert link.control_in(0x42, 0, 4) == b"\x42" * 4


def test_busy_device_takes_data_when_it_can(pipe: Pipe, link: UsbLink, clock: VirtualClock) -> None:
    pipe.busy = True
    with pytest.raises(Timeout):
        link.write(0x01, b"data", timeout_s=0.05)
    assert pipe.received == []
    clock.call_at(clock.now() + 0.02, lambda: setattr(pipe, "busy", False))
    link.write(0x01, b"data", timeout_s=0.05)
    assert pipe.received == [b"data"]


def test_unplugged_device_is_gone_and_comes_back_at_a_new_address(
    backend: SimUsbBackend, pipe: Pipe, link: UsbLink, clock: VirtualClock
) -> None:
    device = _found(backend)
    device.ctrl_transfer(0x80, 8, 0, 0, 1)
    address = device.address
    clock.call_at(clock.now() + 0.02, lambda: backend.unplug(pipe))
    with pytest.raises(LinkLost, match="has gone"):
        link.read(0x81, 512, timeout_s=1.0)
    assert pipe.resets == 1
    assert not link.is_open
    with pytest.raises(usb.core.USBError) as caught:
        device.ctrl_transfer(0x80, 8, 0, 0, 1)
    assert caught.value.errno == errno.ENODEV
    usb.util.dispose_resources(device)
    with pytest.raises(LinkLost, match="no such device"):
        link.open()
    backend.plug(pipe)
    link.open()
    assert _found(backend).address != address


def test_read_moves_the_clock_to_the_moment_the_data_are_due(pipe: Pipe, link: UsbLink, clock: VirtualClock) -> None:
    begin = clock.now()
    clock.call_at(begin + 0.0301, lambda: pipe.to_send.append(b"late"))
    assert link.read(0x81, 512, timeout_s=1.0) == b"late"
    assert clock.now() == pytest.approx(begin + 0.030125, abs=1e-9)  # the end of the microframe


def test_bulk_takes_40_megabytes_a_second(pipe: Pipe, link: UsbLink, clock: VirtualClock) -> None:
    pipe.to_send.append(bytes(400_000))
    begin = clock.now()
    assert len(link.read(0x81, 400_384, timeout_s=1.0)) == 400_000
    assert clock.now() - begin == pytest.approx(0.01, abs=2e-4)


def test_timer_may_use_the_bus_while_a_read_waits(pipe: Pipe, link: UsbLink, clock: VirtualClock) -> None:
    beats: list[float] = []

    def beat() -> None:
        link.control_out(0x31, 0, b"beat")
        beats.append(clock.now())

    timer = clock.every(0.01, beat)
    clock.call_at(clock.now() + 0.055, lambda: pipe.to_send.append(b"data"))
    assert link.read(0x81, 512, timeout_s=1.0) == b"data"
    assert len(beats) == 5
    timer.cancel()


def test_read_into_a_given_buffer_fills_it_in_place(backend: SimUsbBackend, pipe: Pipe) -> None:
    device = _found(backend)
    pipe.to_send.append(b"abc")
    buffer = array("B", bytes(512))
    assert device.read(0x81, buffer, 100) == 3
    assert buffer.tobytes()[:4] == b"abc\0"
    assert len(buffer) == 512
    usb.util.dispose_resources(device)


def test_isochronous_transfers_and_kernel_drivers_are_refused(backend: SimUsbBackend) -> None:
    handle = backend.open_device(backend.enumerate_devices()[0])
    buffer = array("B", bytes(4))
    for call in (backend.iso_read, backend.iso_write):
        with pytest.raises(usb.core.USBError):
            call(handle, 0x81, 0, buffer, 10)
    assert backend.is_kernel_driver_active(handle, 0) is False
    for call in (backend.attach_kernel_driver, backend.detach_kernel_driver):
        with pytest.raises(usb.core.USBError):
            call(handle, 0)
    assert backend.get_parent(handle.device) is None


def test_reset_returns_to_the_first_setting(backend: SimUsbBackend, pipe: Pipe) -> None:
    device = _found(backend)
    device.reset()
    assert pipe.resets == 1
