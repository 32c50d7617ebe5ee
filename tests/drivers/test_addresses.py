"""Serial addresses: what is no port of a device is refused in words, before anything is opened."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from picoradar.drivers.clock import ScaledClock
from picoradar.drivers.errors import LinkLost
from picoradar.drivers.links import SerialLink, checked_address


@pytest.mark.parametrize(
    "address",
    [
        "/dev/ttyUSB0",
        "/dev/serial/by-id/usb-FTDI_FT232R-if00-port0",
        "/dev/pts/3",
        "/tmp/bench/dg645",  # a link to a pty, as `picoradar sim` makes it
        "COM3",
        r"\\.\COM12",
        "socket://192.168.1.20:5025",
        "socket://[::1]:5025",
        "rfc2217://localhost:4000?ign_set_control&timeout=3",
        "sim://bench/dg645",
    ],
)
def test_ports_and_network_ports_are_allowed(address: str) -> None:
    assert checked_address(address) == address


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("spy:///dev/null?file=victim", "spy:// is not opened"),
        ("SPY:///dev/null?file=victim", "spy:// is not opened"),
        ("loop://", "loop:// is not opened"),
        ("alt:///dev/ttyS0?class=PosixPollSerial", "alt:// is not opened"),
        ("hwgrep://.*", "hwgrep:// is not opened"),
        ("file:///etc/passwd", "file:// is not opened"),
        (".os.path://x", r"\.os\.path:// is not opened|is not opened"),
        ("socket://host", "host:port"),
        ("socket://:5025", "host:port"),
        ("socket://host:99999", "no URL"),
        ("socket://user:word@host:5025", "host:port"),
        ("socket://host:5025/path", "host:port"),
        ("socket://host:5025?logging=debug", "option logging"),
        ("rfc2217://host:5025?file=victim", "option file"),
        ("sim://bench/dg645?file=victim", "option file"),
        ("ttyUSB0", "no port or URL"),
        ("COM3:file", "no port or URL"),
        ("/dev/tty USB0", "no port or URL"),
        ("/dev/ttyUSB0\n", "no port or URL"),
        ("\t://x", "no port or URL"),
    ],
)
def test_everything_else_is_refused_in_words(address: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        checked_address(address)
    with pytest.raises(LinkLost, match=words):
        SerialLink(address, ScaledClock(), device="x", baud=9600).open()


@pytest.mark.skipif(os.name == "nt", reason="ports are files on POSIX only")
def test_a_file_that_is_no_port_is_not_opened(tmp_path: Path) -> None:
    file = tmp_path / "thesis.tex"
    file.write_text("content")
    link = tmp_path / "dg645"
    link.symlink_to("/dev/null")
    for address in (file, link, Path("/dev/null"), tmp_path):
        with pytest.raises(LinkLost, match="is no serial port"):
            SerialLink(str(address), ScaledClock(), device="x", baud=9600).open()
