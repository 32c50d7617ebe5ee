"""A USB device as the drivers see it: transfers with time limits and one family of errors.

The pyusb backend is an argument, so that the same driver runs on libusb and on the simulator. No error of pyusb leaves
this class: `usb_errors` translates them.
"""

from __future__ import annotations

import contextlib
import errno
from typing import NoReturn

import usb.core
import usb.util

from picoradar.drivers.clock import Clock
from picoradar.drivers.errors import LinkLost, ProtocolError, Timeout
from picoradar.drivers.links.transcript import TranscribedLink
from picoradar.drivers.links.usb_errors import device_has_gone, translated
from picoradar.drivers.links.usb_find import (
    UsbDevice,
    UsbIdentity,
    configuration_value,
    describe_device,
    find_device,
)

VENDOR_IN = 0xC1  # bmRequestType of vendor requests to the interface
VENDOR_OUT = 0x41
SLICE_S = 0.1  # longest wait inside the bus, so that timers (heartbeats) also run on a real clock


class UsbLink(TranscribedLink):
    """One interface of one USB device, owned by one driver.

    Parameters
    ----------
    identity : UsbIdentity
        Which device on the bus is wanted.
    clock : Clock
        Time for all limits.
    device : str
        The device's name for messages.
    interface : int
        Number of the interface to claim.
    alternate : int
        Its alternate setting; 0 is left as it is.
    backend : object, optional
        A pyusb backend; None is libusb.
    """

    def __init__(
        self,
        identity: UsbIdentity,
        clock: Clock,
        *,
        device: str,
        interface: int = 0,
        alternate: int = 0,
        backend: object | None = None,
    ) -> None:
        self.identity = identity
        super().__init__(clock, device)
        self.device = f"{device} ({identity})"
        self.interface = interface
        self.alternate = alternate
        self.backend = backend
        self._usb: UsbDevice | None = None

    @property
    def is_open(self) -> bool:
        """Get whether the interface is claimed."""
        return self._usb is not None

    def open(self) -> None:
        """Find the device, configure it and claim the interface.

        Raises
        ------
        LinkLost
            When there is no such device, or several and no serial number was given, when access is denied, or when
            the device lacks the expected interface.
        """
        if self._usb is not None:
            return
        found = None
        try:
            found = find_device(self.device, self.identity, self.backend)
            self._claim(found)
        except usb.core.NoBackendError as error:
            raise LinkLost(self.device, "no USB library is installed", "install libusb 1.0") from error
        except usb.core.USBError as error:
            self._fail(error, "cannot be opened")
        except ValueError as error:  # pyusb raises this when there is no such interface or setting
            remedy = "another kind of device has this identity: check the settings"
            raise LinkLost(self.device, f"cannot be opened: {error}", remedy) from error
        finally:
            if found is not None and self._usb is None:
                with contextlib.suppress(usb.core.USBError):
                    usb.util.dispose_resources(found)
        if self.transcript is not None:
            self._note("open", **describe_device(found))

    def close(self) -> None:
        """Release the interface; harmless when it is closed or the device has vanished."""
        device, self._usb = self._usb, None
        if device is not None:
            with contextlib.suppress(usb.core.USBError):  # a vanished device cannot be released in order
                usb.util.dispose_resources(device)
            self._note("close")

    def control_in(
        self,
        request: int,
        value: int,
        length: int,
        *,
        kind: int = VENDOR_IN,
        index: int | None = None,
        timeout_s: float = 0.5,
    ) -> bytes:
        """Make a request whose data go from device to host, and return them (at most ``length`` bytes).

        Parameters
        ----------
        request, value, length, kind : int
            bRequest, wValue, wLength and bmRequestType; by default a vendor request to the interface.
        index : int, optional
            wIndex; None is the claimed interface.
        timeout_s : float

        Raises
        ------
        Stall
            When the device refuses it.
        """
        index = self.interface if index is None else index
        device = self._opened()
        asked = {"kind": kind, "request": request, "value": value, "index": index}
        try:
            data = bytes(device.ctrl_transfer(kind, request, value, index, length, _ms(timeout_s)))
        except usb.core.USBError as error:
            self._fail(error, f"control request {request:#04x}", "control", **asked)
        self._note("control", data, **asked)
        return data

    def control_out(self, request: int, value: int, data: bytes = b"", *, timeout_s: float = 0.5) -> None:
        """Make a vendor request to the interface whose data go from host to device.

        Raises
        ------
        Stall
            When the device refuses it.
        """
        device = self._opened()
        asked = {"kind": VENDOR_OUT, "request": request, "value": value, "index": self.interface}
        try:
            done = device.ctrl_transfer(VENDOR_OUT, request, value, self.interface, data, _ms(timeout_s))
        except usb.core.USBError as error:
            self._fail(error, f"control request {request:#04x}", "control", data, **asked)
        self._note("control", data, **asked)
        if done != len(data):
            raise ProtocolError(self.device, f"control request {request:#04x} took {done} of {len(data)} bytes")

    def write(self, endpoint: int, data: bytes, *, timeout_s: float) -> None:
        """Send ``data`` to a bulk or interrupt OUT endpoint.

        Raises
        ------
        Timeout
            When the device does not take all of it.
        """
        device = self._opened()
        try:
            sent = device.write(endpoint, data, _ms(timeout_s))
            self._note("write", data[:sent], endpoint=endpoint)
        except usb.core.USBError as error:
            self._fail(error, f"write to endpoint {endpoint:#04x}", "write", data, endpoint=endpoint)
        if sent != len(data):
            raise Timeout(self.device, f"took {sent} of {len(data)} bytes on endpoint {endpoint:#04x}")

    def read(self, endpoint: int, size: int, *, timeout_s: float) -> bytes:
        """Read one transfer from a bulk or interrupt IN endpoint (up to ``size`` bytes).

        Raises
        ------
        Timeout
            When nothing comes within ``timeout_s``. Data that came before the limit are returned.
        """
        end = self.clock.now() + self.clock.patience_s(timeout_s)
        while True:
            device = self._opened()
            left_s = end - self.clock.now()
            try:
                data = device.read(endpoint, size, _ms(min(max(left_s, 0.0), SLICE_S))).tobytes()
                self._note("read", data, endpoint=endpoint)
                return data
            except usb.core.USBTimeoutError as error:
                self.clock.run_due()
                if self.clock.now() >= end:
                    self._fail(error, f"read from endpoint {endpoint:#04x} within {timeout_s:g} s")
            except usb.core.USBError as error:
                self._fail(error, f"read from endpoint {endpoint:#04x}", "read", endpoint=endpoint)

    def clear_halt(self, endpoint: int) -> None:
        """Take an endpoint out of its halt after a `Stall`."""
        device = self._opened()
        try:
            device.clear_halt(endpoint)
            self._note("clear_halt", endpoint=endpoint)
        except usb.core.USBError as error:
            self._fail(error, f"clear halt of endpoint {endpoint:#04x}")

    def _claim(self, found: UsbDevice) -> None:
        if found.bNumConfigurations and configuration_value(found) == 0:
            found.set_configuration()
        if self.backend is None and found.is_kernel_driver_active(self.interface):
            found.detach_kernel_driver(self.interface)
        usb.util.claim_interface(found, self.interface)
        if self.alternate:
            found.set_interface_altsetting(self.interface, self.alternate)
        self._usb = found

    def _opened(self) -> UsbDevice:
        if self._usb is None:
            raise LinkLost(self.device, "the device is not open", "connect first")
        return self._usb

    def _fail(
        self, error: usb.core.USBError, doing: str, what: str = "", data: bytes = b"", /, **more: object
    ) -> NoReturn:
        """Raise the drivers' error; a stalled transfer (``what``) goes into the transcript first."""
        if what and error.errno == errno.EPIPE:
            self._note(what, data, error="stall", **more)
        if device_has_gone(error):
            self._note("lost", error=str(error))
            self.close()
        raise translated(error, self.device, doing) from error


def _ms(seconds: float) -> int:
    return max(1, round(seconds * 1000))  # 0 means "for ever" to USB
