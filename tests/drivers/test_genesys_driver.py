"""Genesys: the driver alone, against a script of what it sends and what a supply answers."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from picoradar.drivers.errors import DeviceFault, LimitError, ProtocolError, Timeout
from picoradar.drivers.genesys import Fault, Genesys, Status
from picoradar.drivers.genesys.wire import SupplyState

GOLDEN = tomllib.loads((Path(__file__).parents[1] / "golden" / "genesys.toml").read_text())
SHEET = [(sent.encode(), reply.encode()) for sent, reply in GOLDEN["exchange"]]


def test_state_as_the_manual_prints_it(scripted):
    [(sent, reply)] = GOLDEN["example_of_the_manual"]
    assert Genesys(scripted([(sent.encode(), reply.encode())])).state() == SupplyState(
        45.201, 45.0, 4.3257, 10.0, Status.AUTO_START | Status.FOLDBACK_ENABLED, Fault(0)
    )


def test_opening_sequence(scripted):
    link = scripted(
        [
            (b"\r", b""),
            *SHEET[:3],
            (b"OUT?\r", b"ON\r"),  # an earlier program has left it on
            *SHEET[3:5],
            (b"OUT?\r", b"OFF\r"),
            (b"AST?\r", b"OFF\r"),
        ]
    )
    supply = Genesys(link)
    supply.open()
    assert supply.found_on == ("supply",)


def test_a_supply_that_keeps_its_auto_start_is_refused(scripted):
    """With it the output would come back by itself when the interlock closes (sheet ``tdk_genesys``)."""
    link = scripted([(b"\r", b""), *SHEET[:3], (b"OUT?\r", b"OFF\r"), *SHEET[3:5], (b"OUT?\r", b"OFF\r"),
                     (b"AST?\r", b"ON\r")])  # fmt: skip
    with pytest.raises(DeviceFault, match="auto-start"):
        Genesys(link).open()


def test_nothing_is_sent_out_of_range(scripted):
    with pytest.raises(LimitError, match="voltage_v 631 V is outside 0 to 630 V; nothing was sent"):
        Genesys(scripted([])).voltage_v = 631


def test_late_reply_does_not_answer_the_next_message(scripted):
    link = scripted(
        [
            (b"MV?\r", b""),
            (b"ADR 6\r", b"123.45\r"),  # late; then what the supply says to ADR and IDN?
            (b"IDN?\r", b"OK\rLAMBDA,GEN600-1.3\r"),
            (b"MV?\r", b"290.01\r"),
        ]
    )
    assert Genesys(link).measured_v == 290.01


def test_three_tries_then_a_timeout(scripted):
    link = scripted([(b"MV?\r", b""), (b"ADR 6\r", b""), (b"ADR 6\r", b"")])
    with pytest.raises(Timeout, match=r"no answer to .* within 0\.5 s"):
        _ = Genesys(link).measured_v


def test_another_device_is_refused(scripted):
    link = scripted([(b"\r", b""), (b"ADR 6\r", b"OK\r"), (b"IDN?\r", b"SRS,DG645,1,2\r")])
    with pytest.raises(ProtocolError, match="another device answers"):
        Genesys(link).open()


def test_address_out_of_range(scripted):
    with pytest.raises(LimitError, match="address 31 is outside 0 to 30"):
        Genesys(scripted([]), address=31)
