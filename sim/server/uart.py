"""What a serial receiver gets of bytes that were sent at another baud rate."""

from __future__ import annotations

import math


def heard(data: bytes, *, sent_baud: float, read_baud: float) -> bytes:
    """Sample a line (8 data bits, no parity, 1 stop bit) as a receiver with its own baud rate does.

    The receiver waits for a falling edge, then looks at the line in the middle of each of *its* bits. Rates within
    about 5 % give the same bytes, others give garbage: more bytes or fewer, always the same for the same input.

    Parameters
    ----------
    data : bytes
        Sent one after the other, with no gaps; the line is idle (high) before and after.
    sent_baud, read_baud : float
        Bits per second of sender and receiver; 0 is a port that is hung up, which neither sends nor hears.

    Returns
    -------
    bytes
        What was received; a byte whose stop bit is missing is delivered as it was sampled.
    """
    if sent_baud == read_baud:
        return data
    if not (sent_baud > 0 and read_baud > 0):
        return b""
    line = [bit for byte in data for bit in (0, *(byte >> i & 1 for i in range(8)), 1)]
    step = sent_baud / read_baud  # sender's bits in one of the receiver's
    received = bytearray()
    start = 0
    while (edge := _falling_edge(line, start)) is not None:
        received.append(sum(_level(line, edge + (1.5 + i) * step) << i for i in range(8)))
        start = math.ceil(edge + 9.5 * step)
    return bytes(received)


def _falling_edge(line: list[int], start: int) -> int | None:
    for at in range(start, len(line)):
        if not line[at] and (at == 0 or line[at - 1]):
            return at
    return None


def _level(line: list[int], position: float) -> int:
    at = int(position)
    return line[at] if at < len(line) else 1
