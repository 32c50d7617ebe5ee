"""The state table: reachable, closed, and with words for a misplaced verb."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from picoradar.instrument.controller import STATES, TRANSITIONS, allowed_verbs, diagram
from picoradar.instrument.controller.machine import StateMachine
from picoradar.instrument.errors import NotAllowed


def machine() -> tuple[StateMachine, list[tuple[str, str, str]]]:
    changes: list[tuple[str, str, str]] = []
    return StateMachine(lambda old, new, verb: changes.append((old, new, verb))), changes


def test_every_state_is_reachable_and_can_be_left() -> None:
    reached = {"off"}
    for _ in STATES:
        reached |= {t.target for t in TRANSITIONS if reached & set(t.sources)}
    assert reached == set(STATES)
    assert all(allowed_verbs(state) for state in STATES)


def test_a_misplaced_verb_says_what_is_allowed_now() -> None:
    m, _ = machine()
    with pytest.raises(NotAllowed, match="cannot start scan in state 'off'; allowed now: connect"):
        m.go("start_scan")
    assert m.state == "off"


def test_an_exception_on_entry_leads_to_fault_and_keeps_the_first_cause() -> None:
    m, changes = machine()

    def broken() -> None:
        raise RuntimeError("no answer")

    with pytest.raises(RuntimeError, match="no answer"):
        m.go("connect", broken)
    assert m.state == "fault"
    assert m.cause == "connect: no answer"
    m.fail("something later")
    assert m.cause == "connect: no answer"
    assert ("connected", "fault", "fail") in changes
    with pytest.raises(NotAllowed, match="no answer"):
        m.go("connect")


@given(verbs=st.lists(st.sampled_from(sorted({t.verb for t in TRANSITIONS})), max_size=30))
def test_whatever_is_asked_the_machine_follows_the_table(verbs: list[str]) -> None:
    m, _ = machine()
    table = {(source, t.verb): t.target for t in TRANSITIONS for source in t.sources}
    for verb in verbs:
        before = m.state
        try:
            m.go(verb)
        except NotAllowed:
            assert (before, verb) not in table
            assert m.state == before
        else:
            assert m.state == table[before, verb]


def test_the_diagram_names_every_state_and_verb() -> None:
    text = diagram()
    assert all(state in text for state in STATES)
    assert all(t.verb in text for t in TRANSITIONS)
