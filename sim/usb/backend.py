# ruff: noqa: ARG002 (the arguments are those of pyusb's interface)
"""A pyusb backend whose bus is the simulated bench: pass it to ``usb.core.find(backend=...)``."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from typing import SupportsInt

from picoradar.drivers.clock import Clock
from picoradar.sim.usb import errors
from picoradar.sim.usb.bus import SimUsbDevice
from picoradar.sim.usb.described import DescribedBackend
from picoradar.sim.usb.firmware import Setup, UsbFirmware


class UsbHandle:
    """One opening of a device."""

    def __init__(self, device: SimUsbDevice) -> None:
        self.device = device


class SimUsbBackend(DescribedBackend):
    """All that pyusb asks of a bus.

    A read moves the clock to the moment when its data are due and runs what falls due on the way; a
    timer may use the bus meanwhile.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    devices : iterable of UsbFirmware
        What is plugged in.
    """

    def __init__(self, clock: Clock, devices: Iterable[UsbFirmware] = ()) -> None:
        self.clock = clock
        self._devices: list[SimUsbDevice] = []
        self._next_address = 1
        for firmware in devices:
            self.plug(firmware)

    def plug(self, firmware: UsbFirmware) -> SimUsbDevice:
        """Plug a device in; it gets a new address."""
        device = SimUsbDevice(firmware, self.clock, self._next_address)
        self._next_address += 1
        self._devices.append(device)
        return device

    def unplug(self, firmware: UsbFirmware) -> None:
        """Pull a device's cable: every handle on it now fails with ENODEV."""
        for device in [d for d in self._devices if d.firmware is firmware]:
            self._devices.remove(device)
            device.unplug()

    def device_of(self, firmware: UsbFirmware) -> SimUsbDevice:
        """Get the plugged-in device of a firmware.

        Raises
        ------
        LookupError
            When it is not plugged in.
        """
        for device in self._devices:
            if device.firmware is firmware:
                return device
        raise LookupError(f"{firmware!r} is not plugged in")

    def enumerate_devices(self) -> list[SimUsbDevice]:
        """Get what is plugged in now."""
        return list(self._devices)

    # Handles, configuration and claims

    def open_device(self, dev: SimUsbDevice) -> UsbHandle:
        """Open a device."""
        dev.check_plugged()
        return UsbHandle(dev)

    def close_device(self, dev_handle: UsbHandle) -> None:
        """Close a handle; its claims end. Harmless when called late."""
        claims = dev_handle.device.claims
        for interface in [i for i, owner in claims.items() if owner is dev_handle]:
            del claims[interface]

    def set_configuration(self, dev_handle: UsbHandle, config_value: int) -> None:
        """Select a configuration."""
        dev_handle.device.check_plugged()
        dev_handle.device.configure(config_value)

    def get_configuration(self, dev_handle: UsbHandle) -> int:
        """Get the value of the present configuration; 0 means none."""
        dev_handle.device.check_plugged()
        return dev_handle.device.configuration

    def set_interface_altsetting(self, dev_handle: UsbHandle, intf: int, altsetting: int) -> None:
        """Select an alternate setting."""
        self._claimed(dev_handle, intf).select_alternate(intf, altsetting)

    def claim_interface(self, dev_handle: UsbHandle, intf: int) -> None:
        """Take an interface for this handle alone."""
        device = dev_handle.device
        device.check_plugged()
        if device.claims.setdefault(intf, dev_handle) is not dev_handle:
            raise errors.busy()

    def release_interface(self, dev_handle: UsbHandle, intf: int) -> None:
        """Give an interface back; the device returns to alternate setting 0."""
        device = dev_handle.device
        if device.claims.get(intf) is not dev_handle:
            return
        del device.claims[intf]
        if device.plugged and device.alternates.get(intf):
            device.select_alternate(intf, 0)

    # Transfers

    def bulk_write(self, dev_handle: UsbHandle, ep: int, intf: int, data: array[int], timeout: int) -> int:
        """Write one transfer; returns the bytes taken."""
        return self._claimed(dev_handle, intf).write(ep, data.tobytes(), _seconds(timeout))

    def bulk_read(self, dev_handle: UsbHandle, ep: int, intf: int, buff: array[int], timeout: int) -> int:
        """Read one transfer into ``buff``; returns its length."""
        return self._claimed(dev_handle, intf).read_into(ep, buff, _seconds(timeout))

    intr_write = bulk_write
    intr_read = bulk_read

    def ctrl_transfer(
        self,
        dev_handle: UsbHandle,
        bmRequestType: int,
        bRequest: int,
        wValue: int,
        wIndex: int,
        data: array[int],
        timeout: int,
    ) -> int:
        """Carry out a control transfer; returns the length of its data stage."""
        setup = Setup(bmRequestType, bRequest, wValue, wIndex, len(data))
        if not setup.to_host:
            dev_handle.device.control(setup, data.tobytes())
            return len(data)
        answer = dev_handle.device.control(setup, b"")
        memoryview(data)[: len(answer)] = memoryview(answer)
        return len(answer)

    def clear_halt(self, dev_handle: UsbHandle, ep: int) -> None:
        """Take an endpoint out of its halt."""
        dev_handle.device.clear_halt(ep)

    def reset_device(self, dev_handle: UsbHandle) -> None:
        """Reset the port."""
        dev_handle.device.check_plugged()
        dev_handle.device.reset()

    @staticmethod
    def _claimed(handle: UsbHandle, interface: SupportsInt) -> SimUsbDevice:
        handle.device.check_plugged()
        if handle.device.claims.get(int(interface)) is not handle:
            raise errors.not_found(f"claim on interface {interface}")
        return handle.device


def _seconds(timeout_ms: int) -> float:
    """Convert pyusb's time limit to seconds; 0 means no limit."""
    return timeout_ms / 1000 if timeout_ms else float("inf")
