"""JSON and TOML of unknown origin: what is beyond the limits is refused in words, whatever the decoder would raise."""

from __future__ import annotations

import json
import struct
import zipfile
import zlib
from pathlib import Path

import pytest

from picoradar.drivers.errors import DECODER_ERRORS, decoder_words, parse_json, parse_toml, read_text


def nested(depth: int) -> str:
    return "[" * depth + "]" * depth


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "Expecting"),
        ("9" * 5000, "4300 digits"),
        (str(2**63), "more than 64 bits"),
        (f'{{"a": [-{2**70}]}}', "more than 64 bits"),
        (nested(40), "nested deeper than 32"),
        (nested(200_000), "nested too deeply"),
        ('{"a":' * 100_000, "nested too deeply"),
    ],
)
def test_json_beyond_the_limits(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        parse_json(text)


def test_json_within_the_limits() -> None:
    content = {"a": [1, 2.5, -(2**63) + 1, None, True, "text"], "b": json.loads(nested(30))}
    assert parse_json(json.dumps(content)) == content
    assert parse_json(json.dumps(content).encode()) == content


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = ", "Invalid value"),
        ("a = " + "9" * 5000, "4300 digits"),
        ("a = 0x" + "f" * 20, "more than 64 bits"),
        ("a = " + nested(100), "nested deeper than 32"),
        ("a = " + nested(5000), "nested too deeply"),
        (".".join("a" * 100) + " = 1", "nested deeper than 32"),
    ],
)
def test_toml_beyond_the_limits(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        parse_toml(text)


def test_toml_within_the_limits() -> None:
    assert parse_toml("[a]\nb = [1, 2]\nc = inf\n") == {"a": {"b": [1, 2], "c": float("inf")}}


def test_a_text_that_is_too_large_or_no_text(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_bytes(b"x = 1 # M\xfcller\n")
    with pytest.raises(ValueError, match="utf-8"):
        read_text(path)
    path.write_text("# " + 100 * "x")
    assert read_text(path, 102) == "# " + 100 * "x"
    with pytest.raises(ValueError, match="larger than 101 bytes"):
        read_text(path, 101)
    with pytest.raises(OSError, match="nowhere"):
        read_text(tmp_path / "nowhere.toml")


def test_every_kind_of_failure_is_in_the_list_and_has_words() -> None:
    def provoked(fails: object) -> Exception:
        try:
            fails()  # type: ignore[operator]
        except Exception as error:  # noqa: BLE001
            return error
        raise AssertionError("did not fail")

    found = [
        provoked(lambda: json.loads("[" * 200_000)),
        provoked(lambda: int("9" * 5000)),
        provoked(lambda: struct.unpack("<q", b"abc")),
        provoked(lambda: zlib.decompress(b"abc")),
        provoked(lambda: zipfile.ZipFile(__file__)),
        provoked(lambda: {}["a"]),
        provoked(lambda: int(float("inf"))),
        provoked(lambda: json.loads(None)),  # type: ignore[arg-type]
        provoked(lambda: bytearray(2**62)),
        provoked(lambda: [].keys()),  # type: ignore[attr-defined]
    ]
    assert {type(error).__name__ for error in found} == {
        "RecursionError", "ValueError", "error", "BadZipFile", "KeyError", "OverflowError", "TypeError", "MemoryError",
        "AttributeError",
    }  # fmt: skip
    for error in found:
        assert isinstance(error, DECODER_ERRORS)
        assert decoder_words(error)
