"""Refusals of the registration package: what was found, and what to do about it."""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib


class RegistrationError(ValueError):
    """Base of every refusal: the input cannot be registered as it stands."""


class MeshError(RegistrationError):
    """The model is no usable surface in millimetres."""


class PointsError(RegistrationError):
    """The measured points, or what belongs to them, cannot be used."""


class StartError(RegistrationError):
    """The start pose or the landmarks cannot be used."""


class DegenerateError(RegistrationError):
    """The geometry leaves a motion free, so that no unique pose exists."""


DECODER_ERRORS: tuple[type[Exception], ...] = (
    ValueError,  # also XML, JSON, base64, UTF-8
    TypeError,
    AttributeError,  # as TypeError: a list where a table should be
    LookupError,
    ArithmeticError,
    EOFError,
    MemoryError,
    RuntimeError,  # also RecursionError, and what zipfile does not implement
    SyntaxError,  # also ParseError of XML, and headers of NumPy arrays
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What decoders (XML, zlib, zipfile, NumPy) raise on damaged or hostile content; every reader here catches these."""
