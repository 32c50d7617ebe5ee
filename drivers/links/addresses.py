"""Serial addresses that may be opened: names of ports, and a closed table of URL schemes.

Settings files and recordings name addresses, and both come from other people. pyserial opens more than ports:
``spy://...?file=NAME`` writes over a file, ``alt://`` takes any class of its modules, ``hwgrep://`` any port that fits
a pattern. What is not in the table here is refused before anything is opened.
"""

from __future__ import annotations

import os
import re
import stat
from urllib.parse import SplitResult, parse_qsl, urlsplit

SCHEMES: dict[str, frozenset[str]] = {
    "socket": frozenset(),
    "rfc2217": frozenset({"ign_set_control", "poll_modem", "timeout"}),
    "sim": frozenset(),
}
"""URL schemes, and the options that each may have: raw TCP, TCP by RFC 2217, simulated port in this process."""

_WINDOWS_PORT = re.compile(r"(\\\\\.\\)?COM[0-9]{1,3}", re.IGNORECASE)
_POSIX_PORT = re.compile(r"/dev/(tty|cu|pts/|rfcomm)[\w.:+/-]*")
_ALLOWED = "give a port (/dev/ttyUSB0, COM3), socket://host:port or rfc2217://host:port"


def checked_address(address: str) -> str:
    """Return a serial address if its form is allowed; nothing is opened or looked up.

    Parameters
    ----------
    address : str
        Port or URL, as in the settings.

    Raises
    ------
    ValueError
        In words: what is not allowed, and what is.
    """
    if not address.isprintable() or " " in address:
        raise ValueError(f"{address!r} is no port or URL; {_ALLOWED}")
    if "://" in address:
        _check_url(address)
    elif not (address.startswith("/") or _WINDOWS_PORT.fullmatch(address)):
        raise ValueError(f"{address!r} is no port or URL; {_ALLOWED}")
    return address


def check_port_file(address: str) -> None:
    """Refuse a name that leads to anything but a serial port; one that leads nowhere is left to who opens it.

    Raises
    ------
    ValueError
        In words.
    """
    if "://" in address or os.name == "nt" or not os.path.exists(address):
        return
    port = os.path.realpath(address)  # udev rules and `picoradar sim` give ports other names by links
    if not (_POSIX_PORT.fullmatch(port) and stat.S_ISCHR(os.stat(port).st_mode)):
        raise ValueError(f"{address!r} is no serial port; {_ALLOWED}")


def _check_url(address: str) -> None:
    try:
        parts = urlsplit(address)
        port, options = parts.port, {name for name, _ in parse_qsl(parts.query, keep_blank_values=True)}
    except ValueError as error:
        raise ValueError(f"{address!r} is no URL ({error}); {_ALLOWED}") from error
    if parts.scheme not in SCHEMES:
        raise ValueError(f"{address!r}: {parts.scheme}:// is not opened; {_ALLOWED}")
    if foreign := options - SCHEMES[parts.scheme]:
        raise ValueError(f"{address!r}: the option {', '.join(sorted(foreign))} is not allowed; leave it out")
    if parts.scheme != "sim" and not _is_host_and_port(parts, port):
        raise ValueError(f"{address!r} is not {parts.scheme}://host:port; {_ALLOWED}")


def _is_host_and_port(parts: SplitResult, port: int | None) -> bool:
    nothing_else = not (parts.username or parts.password or parts.fragment or parts.path.strip("/"))
    return bool(parts.hostname) and port is not None and nothing_else
