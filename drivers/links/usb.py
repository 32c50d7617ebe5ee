"""A USB device as the drivers see it: transfers with time limits and one family of errors.

The pyusb backend is an argument, so that the same driver runs on libusb and on the simulator. This is
the one place that maps ``usb.core.USBError`` to ours.
"""

from __future__ import annotations

import contextlib
import errno
from array import array
from typing import Any, NoReturn

import usb.core
import usb.util

from picoradar.drivers.clock import Clock
from picoradar.drivers.errors import LinkLost, ProtocolError, Stall, Timeout
from picoradar.drivers.links.transcript import Transcript
from picoradar.drivers.links.usb_find import ACCESS_REMEDY, configuration_value, described, find_device

VENDOR_IN = 0xC1  # bmRequestType of vendor requests to the interface
VENDOR_OUT = 0x41
SLICE_S = 0.1  # longest wait inside the bus, so that timers (heartbeats) run on a real clock too


class UsbLink:
    """One interface of one USB device, owned by one driver.

    Parameters
    ----------
    vendor_id, product_id : int
        Identity to look for.
    clock : Clock
        Time for all limits.
    device : str
        The device's name for messages.
    serial_number : str, optional
        Tells several devices of the same kind apart; None takes the only one there is.
    interface : int
        Number of the interface to claim.
    alternate : int
        Its alternate setting; 0 is left as it is.
    interface_class : tuple of int, optional
        Class, subclass and protocol that the interface must have.
    backend : object, optional
        A pyusb backend; None is libusb.

    Attributes
    ----------
    transcript : Transcript or None
        Where every byte both ways is written down; None (the default) for nowhere.
    """

    transcript: Transcript | None = None

    def __init__(
        self,
        vendor_id: int,
        product_id: int,
        clock: Clock,
        *,
        device: str,
        serial_number: str | None = None,
        interface: int = 0,
        alternate: int = 0,
        interface_class: tuple[int, int, int] | None = None,
        backend: Any = None,
    ) -> None:
        self.vendor_id = vendor_id
        self.product_id = product_id
        self.clock = clock
        self.name = device
        self.device = f"{device} (USB {vendor_id:04x}:{product_id:04x})"
        self.serial_number = serial_number
        self.interface = interface
        self.alternate = alternate
        self.interface_class = interface_class
        self.backend = backend
        self._usb: Any = None

    @property
    def is_open(self) -> bool:
        """Get whether the interface is claimed."""
        return self._usb is not None

    def open(self) -> None:
        """Find the device, configure it and claim the interface.

        Raises
        ------
        LinkLost
            When no such device is there, several are and no serial number was given, access is denied, or it
            has not the interface that is expected.
        """
        if self._usb is not None:
            return
        found = None
        try:
            wanted = self.vendor_id, self.product_id, self.serial_number, self.interface_class
            found = find_device(self.device, self.backend, *wanted)
            self._claim(found)
        except usb.core.NoBackendError as error:
            raise LinkLost(self.device, "no USB library is installed", "install libusb 1.0") from error
        except usb.core.USBError as error:
            self._fail(error, "cannot be opened")
        except ValueError as error:  # pyusb's way of saying that there is no such interface or setting
            remedy = "another kind of device has this identity: check the settings"
            raise LinkLost(self.device, f"cannot be opened: {error}", remedy) from error
        finally:
            if found is not None and self._usb is None:
                with contextlib.suppress(usb.core.USBError):
                    usb.util.dispose_resources(found)
        if self.transcript is not None:
            self._note("open", **described(found))

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
        """Request from device to host; returns what came (at most ``length`` bytes).

        Parameters
        ----------
        request, value, length : int
            bRequest, wValue and wLength.
        kind : int
            bmRequestType; a vendor request to the interface unless said otherwise.
        index : int, optional
            wIndex; None is the claimed interface.
        timeout_s : float

        Raises
        ------
        Stall
            When the device refuses it.
        """
        data = self._control(kind, request, value, self.interface if index is None else index, length, timeout_s)
        return bytes(data)

    def control_out(self, request: int, value: int, data: bytes = b"", *, timeout_s: float = 0.5) -> None:
        """Vendor request to the interface, host to device.

        Raises
        ------
        Stall
            When the device refuses it.
        """
        self._control(VENDOR_OUT, request, value, self.interface, data, timeout_s)

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
            self._note_stall(error, "write", data, endpoint=endpoint)
            self._fail(error, f"write to endpoint {endpoint:#04x}")
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
                buffer: array[int] = device.read(endpoint, size, _ms(min(max(left_s, 0.0), SLICE_S)))
                data = buffer.tobytes()
                self._note("read", data, endpoint=endpoint)
                return data
            except usb.core.USBTimeoutError as error:
                self.clock.run_due()
                if self.clock.now() >= end:
                    self._fail(error, f"read from endpoint {endpoint:#04x} within {timeout_s:g} s")
            except usb.core.USBError as error:
                self._note_stall(error, "read", b"", endpoint=endpoint)
                self._fail(error, f"read from endpoint {endpoint:#04x}")

    def clear_halt(self, endpoint: int) -> None:
        """Take an endpoint out of its halt after a `Stall`."""
        device = self._opened()
        try:
            device.clear_halt(endpoint)
            self._note("clear_halt", endpoint=endpoint)
        except usb.core.USBError as error:
            self._fail(error, f"clear halt of endpoint {endpoint:#04x}")

    def _control(self, kind: int, request: int, value: int, index: int, data: int | bytes, timeout_s: float) -> Any:
        device = self._opened()
        asked = {"kind": kind, "request": request, "value": value, "index": index}
        try:
            done = device.ctrl_transfer(kind, request, value, index, data, _ms(timeout_s))
            self._note("control", data if isinstance(data, bytes) else bytes(done), **asked)
        except usb.core.USBError as error:
            self._note_stall(error, "control", data if isinstance(data, bytes) else b"", **asked)
            self._fail(error, f"control request {request:#04x}")
        if kind == VENDOR_OUT and isinstance(data, bytes) and done != len(data):
            raise ProtocolError(self.device, f"control request {request:#04x} took {done} of {len(data)} bytes")
        return done

    def _claim(self, found: Any) -> None:
        if found.bNumConfigurations and configuration_value(found) == 0:
            found.set_configuration()
        if self.backend is None and found.is_kernel_driver_active(self.interface):
            found.detach_kernel_driver(self.interface)
        usb.util.claim_interface(found, self.interface)
        if self.alternate:
            found.set_interface_altsetting(self.interface, self.alternate)
        self._usb = found

    def _opened(self) -> Any:
        if self._usb is None:
            raise LinkLost(self.device, "the device is not open", "connect first")
        return self._usb

    def _note(self, what: str, data: bytes | None = None, **more: Any) -> None:
        if self.transcript is not None:
            self.transcript.note(self.clock.now(), self.name, what, data, **more)

    def _note_stall(self, error: usb.core.USBError, what: str, data: bytes, **more: Any) -> None:
        if error.errno == errno.EPIPE:
            self._note(what, data, error="stall", **more)

    def _fail(self, error: usb.core.USBError, doing: str) -> NoReturn:
        code = error.errno
        if isinstance(error, usb.core.USBTimeoutError) or code == errno.ETIMEDOUT:
            raise Timeout(self.device, f"{doing}: no answer in time", "check power and cable") from error
        if code == errno.EPIPE:
            raise Stall(self.device, f"{doing}: refused (stall)") from error
        if code == errno.EACCES:
            raise LinkLost(self.device, f"{doing}: access denied", ACCESS_REMEDY) from error
        if code == errno.EBUSY:
            raise LinkLost(self.device, f"{doing}: in use by another program", "close the other program") from error
        if code in (errno.ENODEV, errno.ENOENT, errno.ESHUTDOWN, errno.EIO):
            self._note("lost", error=str(error))
            self.close()
            raise LinkLost(self.device, f"{doing}: the device has gone", "plug it in and connect again") from error
        raise ProtocolError(self.device, f"{doing}: {error}") from error


def _ms(seconds: float) -> int:
    return max(1, round(seconds * 1000))  # 0 means "for ever" to USB
