"""Properties as tables: kinds, ranges and docstrings; and numbers as they go over the wire."""

from __future__ import annotations

import math
from enum import IntEnum

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picoradar.drivers.dg645 import DG645
from picoradar.drivers.dg645 import wire as dg645_wire
from picoradar.drivers.dg645.output import OutputPort
from picoradar.drivers.errors import LimitError, ProtocolError
from picoradar.drivers.genesys import Genesys
from picoradar.drivers.genesys import wire as genesys_wire
from picoradar.drivers.links import Control, Reading, read_number
from picoradar.drivers.mecom import Tec, decode, decode_float, decode_int, encode, encode_float, encode_int
from picoradar.sim.firmware.dg645.delays import DelayTree
from picoradar.sim.firmware.dg645.settings import number

MANY = settings(deadline=None, max_examples=100)


class Colour(IntEnum):
    RED = 1
    BLUE = 2


class Table:
    """A device that is a dictionary."""

    device = "table"
    rate_hz = Control("RATE", float, "Control the rate in Hz (float from 1 to 10).", limits=(1, 10), unit="Hz")
    count = Control("COUNT", int, "Control the count (int from 0 to 9).", limits=(0, 9))
    on = Control("ON", bool, "Control whether it is on (bool).", limits=(0, 1))
    colour = Control("COLOUR", Colour, "Control the colour (`Colour`).")
    moving = Control("MOVING", float, "Control something (float).", limits=lambda table: (0, table.most))
    seen = Reading("SEEN", int, "Measure what is seen.")

    def __init__(self):
        self.most = 5.0
        self.values = {"SEEN": 3.0}

    def get_number(self, key):
        return self.values[key]

    def set_number(self, key, value):
        self.values[key] = value


def test_values_come_back_as_their_kind():
    table = Table()
    table.rate_hz, table.count, table.on, table.colour = 2, 3, True, Colour.BLUE
    assert table.values == {"SEEN": 3.0, "RATE": 2.0, "COUNT": 3, "ON": True, "COLOUR": 2}
    assert isinstance(table.rate_hz, float)
    assert (table.count, table.on, table.colour, table.seen) == (3, True, Colour.BLUE, 3)
    assert table.colour is Colour.BLUE


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("rate_hz", 0.5),
        ("rate_hz", math.nan),
        ("rate_hz", math.inf),
        ("count", 10),
        ("count", 1.5),
        ("on", 2),
        ("colour", 3),
        ("moving", 5.1),
    ],
)
def test_what_is_out_of_range_is_not_set(name, value):
    table = Table()
    with pytest.raises(LimitError, match=f"{name} .*nothing was sent"):
        setattr(table, name, value)
    assert table.values == {"SEEN": 3.0}


def test_what_is_of_another_kind_is_not_read():
    table = Table()
    table.values.update(SEEN=1.5, COLOUR=7.0, ON=2.0)
    for name in ("seen", "colour", "on"):
        with pytest.raises(ProtocolError, match=f"reports {name}"):
            getattr(table, name)


def test_a_reading_cannot_be_set():
    assert not hasattr(type(Table.seen), "__set__")
    assert Table.seen.__doc__ == "Measure what is seen."


@pytest.mark.parametrize("device", [DG645, OutputPort, Genesys, Tec])
def test_docstrings_keep_the_grammar(device):
    for name, entry in vars(device).items():
        if isinstance(entry, Control):
            assert entry.__doc__.startswith("Control "), name
            assert entry.__doc__.endswith(")."), name
        elif isinstance(entry, Reading):
            assert entry.__doc__.startswith(("Get ", "Measure ")), name


@MANY
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_dg645_numbers_are_exact_and_understood(value):
    text = dg645_wire.format_number(value)
    assert float(text) == value
    assert float(number(text)) == value


@MANY
@given(st.floats(0, 9999))
def test_genesys_numbers_fit(value):
    text = genesys_wire.format_number(value)
    assert len(text) <= 12
    assert abs(float(text) - value) <= 5.1e-7


@MANY
@given(st.floats(0, 1999.9))  # B follows A by 10 ns from the start, and has to stay within 2000 s
def test_delays_are_rounded_to_5_ps(delay_s):
    tree = DelayTree()
    tree.set(3, 0, number(dg645_wire.format_number(delay_s)))
    assert tree.delay_ps[3] % 5 == 0
    assert abs(dg645_wire.parse_delay(tree.text(3)).delay_s - delay_s) <= 2.5e-12 + 4e-13  # float spacing at 2000 s


@MANY
@given(st.floats(width=32, allow_nan=False), st.integers(-(2**31), 2**31 - 1))
def test_mecom_numbers_go_round(value, whole):
    assert decode_float(encode_float(value)) == value
    assert decode_int(encode_int(whole)) == whole


@MANY
@given(
    st.sampled_from("#!"),
    st.integers(0, 255),
    st.integers(0, 65535),
    st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="#!"), max_size=40),
)
def test_mecom_frames_go_round(control, address, sequence, payload):
    frame = decode(encode(control, address, sequence, payload))
    assert frame[:4] == (control, address, sequence, payload)
    assert frame.is_intact


@MANY
@given(st.text(max_size=12))
def test_only_plain_numbers_are_read(text):
    try:
        value = read_number(text)
    except ValueError:
        return
    assert math.isfinite(value)
    assert set(text) <= set("0123456789+-.eE")


@pytest.mark.parametrize("text", ["", "nan", "inf", "1_0", " 1", "1 ", "٣", "0x10", "1e", "+", "1" * 50])
def test_what_is_no_number(text):
    with pytest.raises(ValueError, match="is no number"):
        read_number(text)


def test_largest_numbers_are_finite():
    assert math.isfinite(read_number("1e308"))
    with pytest.raises(ValueError, match="is no number"):
        read_number("1e999")
