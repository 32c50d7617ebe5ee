"""Sampling bridge protocol (SBP 1.0 and 1.1): identity and capability blocks.

Source: protocol sheet ``sampling_bridge.md``, sections 2.1, 2.2 and 10.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from picoradar.drivers.bridge.sbp.codes import VERSION_1_0, VERSION_1_1, Feature
from picoradar.drivers.bridge.sbp.sealing import open_block, seal


@dataclass(frozen=True)
class Info:
    """Identity block (section 2.1)."""

    version: int
    hardware: int
    firmware: int
    serial_number: str
    model: str
    features: Feature

    _BODY = struct.Struct("<4sHHHH16s24sII")

    def encode(self) -> bytes:
        """Get the 64 bytes of the block."""
        text = (self.serial_number.encode("ascii"), self.model.encode("ascii"))
        return seal(
            self._BODY.pack(b"SLRB", 64, self.version, self.hardware, self.firmware, *text, int(self.features), 0)
        )

    @classmethod
    def decode(cls, data: bytes) -> Info:
        """Read a block; longer ones of later versions are accepted.

        Raises
        ------
        BadBlock
        """
        block = open_block("identity block", data, b"SLRB", 64)
        _, _, version, hardware, firmware, serial, model, features, _ = cls._BODY.unpack_from(block)
        return cls(version, hardware, firmware, _text(serial), _text(model), Feature(features))


@dataclass(frozen=True)
class Caps:
    """Capability block (section 2.2); the defaults are the reference device, version 1.0."""

    version: int = VERSION_1_0
    step_min_fs: int = 1_000
    step_max_fs: int = 100_000
    resolution_fs: int = 100
    depth: int = 16_384
    delay_max_fs: int = 4_000_000_000
    prf_min_hz: int = 20_000
    prf_max_hz: int = 240_000
    nv_per_code: int = 500_000
    zero_code: int = 32
    bits: int = 8
    formats: int = 3
    averages_max: int = 256
    watchdog_min_ms: int = 100
    watchdog_max_ms: int = 5_000
    payload_max: int = 4_096
    header_length: int = 48
    queue_depth: int = 64
    windows_max: int = 0
    entries_max: int = 0

    _BODY = struct.Struct("<4sHHIIIIQIIIHBBHHHHHH")
    _WINDOWS = struct.Struct("<HHHH")

    def encode(self) -> bytes:
        """Get the bytes of the block: 64, or 72 from version 1.1 on."""
        windows = self._WINDOWS.pack(self.windows_max, self.entries_max, 0, 0) if self.version >= VERSION_1_1 else b""
        fields = [getattr(self, name) for name in _CAPS_FIELDS[:-2]]
        return seal(self._BODY.pack(b"SLCP", self._BODY.size + len(windows) + 4, self.version, *fields) + windows)

    @classmethod
    def decode(cls, data: bytes) -> Caps:
        """Read a block; longer ones of later versions are accepted.

        Raises
        ------
        BadBlock
        """
        block = open_block("capability block", data, b"SLCP", 64)
        _, _, version, *fields = cls._BODY.unpack_from(block)
        windows: list[int] = [0, 0]
        if version >= VERSION_1_1 and len(block) >= cls._BODY.size + cls._WINDOWS.size + 4:
            windows = list(cls._WINDOWS.unpack_from(block, cls._BODY.size)[:2])
        return cls(**dict(zip(_CAPS_FIELDS, fields + windows, strict=True)), version=version)


_CAPS_FIELDS = tuple(Caps.__dataclass_fields__)[1:]  # in the order of the block; the last two are of version 1.1


def _text(field: bytes) -> str:
    return field.split(b"\0", 1)[0].decode("ascii", "replace")
