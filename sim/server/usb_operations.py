"""The operations on an opened USB device, each carried out once and without waiting."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import TypeGuard

from picoradar.sim.usb import LONGEST_DATA, Header, SimUsbBackend, UsbHandle, errors

NO_WAITING_MS = -1  # a time limit that has already passed: return what is there now, or time out
ARGUMENTS = {  # of each operation on a handle
    "set_configuration": 1,
    "get_configuration": 0,
    "set_interface_altsetting": 2,
    "claim_interface": 1,
    "release_interface": 1,
    "clear_halt": 1,
    "reset_device": 0,
    "bulk_read": 4,
    "bulk_write": 3,
    "ctrl_transfer": 6,
}
Answer = tuple[object, bytes]


def are_arguments(args: object, op: str) -> TypeGuard[list[int]]:
    """Get whether ``args`` are valid arguments of an operation: the right count of whole numbers of 32 bits."""
    return (
        isinstance(args, list)
        and len(args) == ARGUMENTS.get(op, -1)
        and all(type(a) is int and 0 <= a < 1 << 32 for a in args)
    )


def read(backend: SimUsbBackend, handle: UsbHandle, endpoint: int, interface: int, length: int) -> Answer:
    """Take what has come in on an endpoint."""
    block = array("B", bytes(min(length, LONGEST_DATA)))
    got = backend.bulk_read(handle, endpoint, interface, block, NO_WAITING_MS)
    return None, block[:got].tobytes()


def writer(
    backend: SimUsbBackend, handle: UsbHandle, endpoint: int, interface: int, data: bytes
) -> Callable[[], Answer]:
    """Make the attempts of one OUT transfer: the first moves the data over the bus, the others offer them again."""
    moved = False

    def attempt() -> Answer:
        nonlocal moved
        if not moved:
            moved = True
            backend.bulk_write(handle, endpoint, interface, array("B", data), NO_WAITING_MS)
        elif not handle.device.offer(endpoint, data):
            raise errors.timed_out()
        return len(data), b""

    return attempt


def control(backend: SimUsbBackend, handle: UsbHandle, args: list[int], data: bytes) -> Answer:
    """Carry out a control transfer."""
    kind, request, value, index, length, timeout_ms = args
    to_host = bool(kind & 0x80)
    block = array("B", bytes(min(length, LONGEST_DATA)) if to_host else data)
    done = backend.ctrl_transfer(handle, kind, request, value, index, block, timeout_ms)
    return done, block[:done].tobytes() if to_host else b""


def refused(question: Header) -> Answer:
    """Refuse an invalid question; its values may be of any kind, size and depth, so only their names are repeated."""
    op = question.get("op")
    named = f"the operation {op[:40]!r}" if isinstance(op, str) else "a question without an operation"
    raise errors.not_supported(f"{named}, with {', '.join(sorted(question))[:80]}")
