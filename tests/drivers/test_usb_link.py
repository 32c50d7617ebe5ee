"""USB link: which device is taken, and every error of the bus as one of ours."""

from __future__ import annotations

import errno
from typing import Any

import pytest
import usb.core

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.errors import LinkLost, ProtocolError, Stall, Timeout
from picoradar.drivers.links import UsbIdentity, UsbLink
from picoradar.sim.usb import BULK, Configuration, Device, Endpoint, Interface, Setup, SimUsbBackend


class Silent:
    """A device that takes everything and says nothing."""

    def __init__(self, serial_number: str, interface_class: tuple[int, int, int] = (0xFF, 1, 2)) -> None:
        endpoints = (Endpoint(0x01, BULK, 64), Endpoint(0x81, BULK, 64))
        self.descriptors = Device(
            0x1234,
            0x5678,
            0x0100,
            (Configuration((Interface(endpoints, 0, 0, *interface_class),)),),
            strings=(serial_number,),
            iSerialNumber=1,
        )

    def control(self, setup: Setup, data: bytes) -> bytes:
        return b""

    def receive(self, endpoint: int, data: bytes) -> bool:
        return True

    def take(self, endpoint: int) -> bytes | None:
        return None

    def configured(self, value: int) -> None:
        pass

    def alternate_selected(self, interface: int, alternate: int) -> None:
        pass

    def halt_cleared(self, endpoint: int) -> None:
        pass

    def bus_reset(self) -> None:
        pass


class Failing(SimUsbBackend):
    """A bus on which one call fails."""

    def __init__(self, clock: VirtualClock, call: str, number: int) -> None:
        super().__init__(clock, [Silent("A")])
        setattr(self, call, self._fail)
        self.number = number

    def _fail(self, *_: Any) -> int:
        raise usb.core.USBError("failed", -1, self.number)


def _link(backend: Any, clock: VirtualClock, *, alternate: int = 0, **identity: Any) -> UsbLink:
    wanted = UsbIdentity(0x1234, 0x5678, **identity)
    return UsbLink(wanted, clock, device="thing", alternate=alternate, backend=backend)


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


def test_serial_number_tells_devices_apart(clock: VirtualClock) -> None:
    first, second = Silent("A"), Silent("B")
    backend = SimUsbBackend(clock, [first, second])
    with pytest.raises(LinkLost, match=r"2 such devices are there \(name its serial number"):
        _link(backend, clock).open()
    with pytest.raises(LinkLost, match="no such device with serial number C"):
        _link(backend, clock, serial_number="C").open()
    link = _link(backend, clock, serial_number="B")
    link.open()
    assert list(backend.device_of(second).claims) == [0]
    assert backend.device_of(first).claims == {}
    link.open()
    link.close()
    link.close()
    assert backend.device_of(second).claims == {}


def test_interface_class_tells_devices_apart(clock: VirtualClock) -> None:
    backend = SimUsbBackend(clock, [Silent("A"), Silent("B", (0xFE, 3, 1))])
    link = _link(backend, clock, interface_class=(0xFE, 3, 1))
    link.open()
    link.close()
    with pytest.raises(LinkLost, match="no such device"):
        _link(backend, clock, interface_class=(8, 6, 80)).open()


def test_device_without_the_expected_setting_is_refused_and_left_free(clock: VirtualClock) -> None:
    firmware = Silent("A")
    backend = SimUsbBackend(clock, [firmware])
    link = _link(backend, clock, alternate=1)
    with pytest.raises(LinkLost, match="another kind of device"):
        link.open()
    assert not link.is_open
    assert backend.device_of(firmware).claims == {}


def test_unconfigured_device_is_configured(clock: VirtualClock) -> None:
    firmware = Silent("A")
    backend = SimUsbBackend(clock, [firmware])
    backend.device_of(firmware).configure(0)
    _link(backend, clock).open()
    assert backend.device_of(firmware).configuration == 1


def test_closed_link_says_so(clock: VirtualClock) -> None:
    with pytest.raises(LinkLost, match=r"not open \(connect first\)"):
        _link(SimUsbBackend(clock), clock).read(0x81, 64, timeout_s=0.1)


@pytest.mark.parametrize(
    ("number", "kind", "message"),
    [
        (errno.EACCES, LinkLost, "may not open it: install the udev rule"),
        (errno.EBUSY, LinkLost, "in use by another program"),
        (errno.ENODEV, LinkLost, "the device has gone"),
        (errno.EIO, LinkLost, "the device has gone"),
        (errno.ETIMEDOUT, Timeout, "no answer in time"),
        (errno.EPIPE, Stall, "refused"),
        (errno.EOVERFLOW, ProtocolError, "failed"),
    ],
)
@pytest.mark.parametrize("call", ["claim_interface", "bulk_write", "bulk_read", "ctrl_transfer", "clear_halt"])
def test_every_error_of_the_bus_is_one_of_ours(
    clock: VirtualClock, call: str, number: int, kind: type[Exception], message: str
) -> None:
    link = _link(Failing(clock, call, number), clock)

    def use() -> None:
        link.open()
        link.write(0x01, b"data", timeout_s=0.1)
        link.control_out(1, 0)
        link.clear_halt(0x81)
        link.read(0x81, 64, timeout_s=0.1)

    with pytest.raises(kind, match=message):
        use()
    if message == "the device has gone":
        assert not link.is_open


def test_strings_that_may_not_be_read_are_a_matter_of_access(clock: VirtualClock) -> None:
    link = _link(Failing(clock, "ctrl_transfer", errno.EACCES), clock, serial_number="A")
    with pytest.raises(LinkLost, match="access denied"):
        link.open()


def test_time_limit_is_kept(clock: VirtualClock) -> None:
    link = _link(SimUsbBackend(clock, [Silent("A")]), clock)
    link.open()
    for limit_s in (0.0, 0.005, 0.0325, 0.75):
        begin = clock.now()
        with pytest.raises(Timeout, match=f"within {limit_s:g} s"):
            link.read(0x81, 64, timeout_s=limit_s)
        assert limit_s <= clock.now() - begin <= limit_s + 0.0021


def test_short_control_answer_is_given_as_it_came(clock: VirtualClock) -> None:
    link = _link(SimUsbBackend(clock, [Silent("A")]), clock)
    link.open()
    assert link.control_in(1, 0, 64) == b""
