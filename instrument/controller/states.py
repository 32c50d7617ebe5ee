"""States and transitions of the controller: the one table that the machine and the documents are made from."""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

State = Literal["off", "connected", "warming", "ready", "scanning", "paused", "fault"]

STATES: Final[dict[State, str]] = {
    "off": "no link is open",
    "connected": "all devices answer and are in their safe state",
    "warming": "the diode is brought to its temperature; no light",
    "ready": "diode stable, everything switched off that makes light",
    "scanning": "laser on, records are taken",
    "paused": "between two lines, laser off, the rest of the raster still to do",
    "fault": "something failed; safe state tried and its outcome kept; latched until acknowledged",
}


class Transition(NamedTuple):
    """One arrow of the diagram: ``verb`` leads from any of ``sources`` to ``target``."""

    verb: str
    sources: tuple[State, ...]
    target: State


TRANSITIONS: Final[tuple[Transition, ...]] = (
    Transition("connect", ("off",), "connected"),
    Transition("warm_up", ("connected", "ready"), "warming"),
    Transition("warmed", ("warming",), "ready"),
    Transition("cancel_warm_up", ("warming",), "connected"),
    Transition("start_scan", ("ready",), "scanning"),
    Transition("pause", ("scanning",), "paused"),
    Transition("resume", ("paused",), "scanning"),
    Transition("end_scan", ("scanning", "paused"), "ready"),
    Transition("fail", ("off", "connected", "warming", "ready", "scanning", "paused", "fault"), "fault"),
    Transition("acknowledge", ("fault",), "off"),
    Transition("shut_down", ("connected", "warming", "ready"), "off"),
)


def allowed_verbs(state: str) -> list[str]:
    """Get the verbs that lead out of ``state`` (``fail`` is not a verb for people)."""
    return [t.verb for t in TRANSITIONS if state in t.sources and t.verb != "fail"]


def diagram() -> str:
    """Draw the table as a Mermaid state diagram."""
    lines = ["stateDiagram-v2", "    [*] --> off"]
    for t in TRANSITIONS:
        sources: tuple[str, ...] = ("any",) if len(t.sources) == len(STATES) else t.sources
        lines += [f"    {source} --> {t.target}: {t.verb}" for source in sources]
    return "\n".join(lines)
