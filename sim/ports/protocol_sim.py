"""``sim://bench/device``: a simulated serial port in this process, for unchanged pyserial programs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from serial.serialutil import PortNotOpenError, SerialBase, SerialException

from picoradar.sim.ports.wire import SerialWire, wire_at

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class Serial(SerialBase):
    """A port of the simulated bench; behaves as a native one does, errors included."""

    BAUDRATES = (300, 600, 1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600, 1000000)

    _wire: SerialWire | None = None

    def open(self) -> None:
        """Open the port.

        Raises
        ------
        serial.SerialException
            When it is open already, in use, or not there.
        """
        if self.is_open:
            raise SerialException("Port is already open.")
        url = str(self.port)
        wire = wire_at(url)
        if wire is None or not wire.plugged:
            raise SerialException(2, f"could not open port {url}: no such simulated port")
        if wire.host_open:
            raise SerialException(16, f"could not open port {url}: in use")
        self._wire = wire
        wire.host_open = True
        wire.discard()
        self.is_open = True

    def close(self) -> None:
        """Close the port; what the device sends afterwards is lost."""
        if self._wire is not None:
            self._wire.host_open = False
            self._wire = None
        self.is_open = False

    def read(self, size: int = 1) -> bytes:
        """Read up to ``size`` bytes within the port's timeout, moving the bench's clock meanwhile."""
        wire = self._opened()
        data = wire.read(size, self.timeout)
        if not data and not wire.plugged:
            raise SerialException("device reports readiness to read but returned no data (device disconnected?)")
        return data

    def write(self, data: ReadableBuffer, /) -> int:
        """Send bytes to the device."""
        wire = self._opened()
        if not wire.plugged:
            raise SerialException(5, "write failed: [Errno 5] Input/output error")
        sent = bytes(data)
        wire.write(sent)
        return len(sent)

    @property
    def in_waiting(self) -> int:
        """Get the number of bytes received and not read."""
        wire = self._opened()
        if not wire.plugged:
            raise OSError(5, "Input/output error")  # a bare OSError, as a pulled cable gives with native ports
        return wire.waiting

    def reset_input_buffer(self) -> None:
        """Discard what has been received and not read."""
        self._opened().discard()

    def reset_output_buffer(self) -> None:
        """Do nothing: bytes are on the line at once."""

    def flush(self) -> None:
        """Do nothing: bytes are on the line at once."""

    def _opened(self) -> SerialWire:
        if self._wire is None:
            raise PortNotOpenError
        return self._wire

    def _reconfigure_port(self, *, force_update: bool = False) -> None:
        """Settings are read when they matter; a timeout needs no reconfiguration."""

    def _update_break_state(self) -> None:
        """The devices of this bench do not look at breaks."""

    def _update_rts_state(self) -> None:
        """The devices of this bench have no modem lines."""

    def _update_dtr_state(self) -> None:
        """The devices of this bench have no modem lines."""
