"""Mutations of files: bytes, numbers, pieces of other files, and the structure inside (JSON, archives)."""

from __future__ import annotations

import io
import json
import random
import struct
import zipfile
from collections.abc import Callable, Sequence

Mutation = Callable[[random.Random, bytes], bytes]

NUMBERS = (
    b"0", b"-1", b"1e309", b"-inf", b"nan", b"NaN", b"4294967295", b"4294967296", b"-2147483649", b"1e-320", b"0x10",
    b"9223372036854775808", b"9" * 4400, b"1_000", b"1,5", b"", b"null", b"true", b'"text"', b"[]", b"{}", b"1e18",
)  # fmt: skip
WHOLE = (0, 1, -1, 127, 255, 256, 32767, 65535, 2**31 - 1, -(2**31), 2**32 - 1, 2**62, -(2**63))
VALUES: tuple[object, ...] = (
    None, True, 0, -1, 1.5, 1e308, 2**31, 2**63 - 1, 10**30, float("inf"), float("nan"), "", "text", "\0", "9" * 300,
    [], {}, [[]], [None], {"a": None}, [0] * 300, "/etc/passwd", "http://127.0.0.1:9/",
)  # fmt: skip


def flip(rng: random.Random, content: bytes) -> bytes:
    """Change a few bits."""
    changed = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 8))):
        if changed:
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def noise(rng: random.Random, content: bytes) -> bytes:
    """Write random bytes over some."""
    at, size = _place(rng, content, 64)
    return content[:at] + rng.randbytes(size) + content[at + size :]


def constant(rng: random.Random, content: bytes) -> bytes:
    """Write zeros or ones over some, as a damaged disk does."""
    at, size = _place(rng, content, 512)
    return content[:at] + rng.choice((b"\0", b"\xff")) * size + content[at + size :]


def truncate(rng: random.Random, content: bytes) -> bytes:
    """Cut the end off."""
    return content[: rng.randrange(len(content) + 1)]


def remove(rng: random.Random, content: bytes) -> bytes:
    """Take a piece out."""
    at, size = _place(rng, content, 200)
    return content[:at] + content[at + size :]


def double(rng: random.Random, content: bytes) -> bytes:
    """Repeat a piece, up to a thousand times."""
    at, size = _place(rng, content, 200)
    return content[:at] + content[at : at + size] * rng.choice((2, 2, 3, 1000)) + content[at + size :]


def move(rng: random.Random, content: bytes) -> bytes:
    """Copy a piece to another place."""
    at, size = _place(rng, content, 200)
    to = rng.randrange(len(content) + 1)
    return content[:to] + content[at : at + size] + content[to + size * rng.randrange(2) :]


def whole_number(rng: random.Random, content: bytes) -> bytes:
    """Write an extreme whole number over one to eight bytes."""
    width = rng.choice((1, 2, 4, 4, 8))
    at = rng.randrange(max(1, len(content) - width + 1))
    value = rng.choice(WHOLE) % 2 ** (8 * width)
    return content[:at] + value.to_bytes(width, rng.choice(("little", "big"))) + content[at + width :]


def text_number(rng: random.Random, content: bytes) -> bytes:
    """Put an extreme in place of a number in the text."""
    digits = [k for k in range(len(content)) if content[k : k + 1].isdigit()] if len(content) < 20_000 else []
    at = rng.choice(digits) if digits else rng.randrange(len(content) + 1)
    end = at
    while end < len(content) and content[end : end + 1] in b"0123456789.eE+-":
        end += 1
    return content[:at] + rng.choice(NUMBERS) + content[end:]


def nest(rng: random.Random, content: bytes) -> bytes:
    """Open many brackets."""
    at = rng.randrange(len(content) + 1)
    return (
        content[:at] + rng.choice((b"[", b'{"a":', b"(", b"<a>", b"\n", b" ")) * rng.choice((10, 2000)) + content[at:]
    )


BYTES: tuple[Mutation, ...] = (
    flip, flip, noise, constant, truncate, remove, double, move, whole_number, text_number, text_number, nest,
)  # fmt: skip


def mutated(
    rng: random.Random, seeds: Sequence[bytes], own: Sequence[Mutation] = (), words: Sequence[bytes] = ()
) -> bytes:
    """Mutate one of the seeds a few times.

    Parameters
    ----------
    rng : random.Random
    seeds : sequence of bytes
        Sound files of the format.
    own : sequence of mutations
        Those that know the format; they take half of the first steps.
    words : sequence of bytes
        Words of the format, to be put in.
    """
    content = rng.choice(seeds)
    for step in range(rng.choice((1, 1, 1, 2, 3, 6))):
        if step == 0 and own and rng.random() < 0.5:
            content = rng.choice(own)(rng, content)
        elif words and rng.random() < 0.15:
            at = rng.randrange(len(content) + 1)
            content = content[:at] + rng.choice(words) + content[at:]
        elif rng.random() < 0.05:
            other = rng.choice(seeds)
            content = content[: rng.randrange(len(content) + 1)] + other[rng.randrange(len(other) + 1) :]
        else:
            content = rng.choice(BYTES)(rng, content)
    return content


def json_value(rng: random.Random, content: bytes) -> bytes:
    """Change a value or a key somewhere in a JSON text, which stays JSON."""
    try:
        table = json.loads(content)
    except (ValueError, RecursionError):
        return flip(rng, content)
    return json.dumps(changed_value(rng, table)).encode()


def changed_value(rng: random.Random, content: object) -> object:
    """Change a value or a key somewhere in plain data."""
    if rng.random() < 0.15 or not isinstance(content, dict | list) or not content:
        return rng.choice(VALUES)
    if isinstance(content, list):
        at = rng.randrange(len(content))
        if rng.random() < 0.1:
            return content[:at] + content[at + 1 :] + [content[at]] * rng.randrange(3)
        return [*content[:at], changed_value(rng, content[at]), *content[at + 1 :]]
    key = rng.choice(list(content))
    chosen = rng.random()
    if chosen < 0.1:
        return {k: v for k, v in content.items() if k != key}
    if chosen < 0.2:
        return {**content, rng.choice(("x", "", key.upper())): content[key]}
    return {**content, key: changed_value(rng, content[key])}


def glb_table(rng: random.Random, content: bytes) -> bytes:
    """Change a value in the JSON of a GLB file, with lengths that fit."""
    length = int.from_bytes(content[12:16], "little")
    try:
        text = json_value(rng, content[20 : 20 + length])
    except UnicodeDecodeError:
        return flip(rng, content)
    text += b" " * (-len(text) % 4)
    rest = content[20 + length :]
    head = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON")
    return head + text + rest


def archive_member(rng: random.Random, content: bytes) -> bytes:
    """Mutate a member of a zip archive, with check sums that fit."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except Exception:  # noqa: BLE001  # no longer an archive
        return flip(rng, content)
    if not members:
        return content
    name = rng.choice(list(members))
    members[name] = rng.choice(BYTES)(rng, members[name][:200]) + members[name][200:]
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as archive:
        for key, member in members.items():
            archive.writestr(key, member)
    return made.getvalue()


def _place(rng: random.Random, content: bytes, longest: int) -> tuple[int, int]:
    size = min(len(content), 1 + rng.randrange(longest))
    return rng.randrange(len(content) - size + 1), size
