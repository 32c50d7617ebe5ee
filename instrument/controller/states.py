"""States and transitions of the controller: the one table that the machine and the documents are made from."""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

State = Literal["off", "connected", "warming", "ready", "scanning", "paused", "suspended", "fault"]

STATES: Final[dict[State, str]] = {
    "off": "no link is open",
    "connected": "all devices answer and are in their safe state",
    "warming": "the diode is brought to its temperature; no light",
    "ready": "diode stable, everything switched off that makes light",
    "scanning": "laser on, records are taken; the only state in which the gate is open",
    "paused": "between two lines, laser off, the rest of the raster still to do; waits for a person",
    "suspended": "laser off; a link is lost or an interlock does not hold; goes on by itself when it is well again",
    "fault": "something failed; safe state tried and its outcome kept; latched until acknowledged",
}


BUSY: Final[tuple[State, ...]] = ("warming", "scanning", "paused", "suspended")
"""States in which a verb is being carried out: one thread owns the devices, all others may only ask."""


class Transition(NamedTuple):
    """One arrow of the diagram: ``verb`` leads from any of ``sources`` to ``target``."""

    verb: str
    sources: tuple[State, ...]
    target: State
    meaning: str


TRANSITIONS: Final[tuple[Transition, ...]] = (
    Transition("connect", ("off",), "connected", "open every link, identify, everything off"),
    Transition("warm_up", ("connected", "ready"), "warming", "bring the diode to its temperature"),
    Transition("warmed", ("warming",), "ready", "the diode is stable"),
    Transition("cancel_warm_up", ("warming",), "connected", "a person stopped the warm-up; the diode is off"),
    Transition("start_scan", ("ready",), "scanning", "interlocks hold, supply and triggers on; the gate opens"),
    Transition("pause", ("scanning",), "paused", "a person asked for it; after the line in hand"),
    Transition("resume", ("paused",), "scanning", "a person asked for it; the gate opens again"),
    Transition("suspend", ("scanning", "paused"), "suspended", "a link is lost, or an interlock of this action trips"),
    Transition("recover", ("suspended",), "scanning", "identities checked, settings applied again, interlocks hold"),
    Transition("end_scan", ("scanning", "paused", "suspended"), "ready", "complete, finished early or aborted"),
    Transition(
        "fail",
        ("off", "connected", "warming", "ready", "scanning", "paused", "suspended", "fault"),
        "fault",
        "an entry action failed, an interlock tripped, a limit passed, or emergency off",
    ),
    Transition("acknowledge", ("fault",), "off", "a person has read the cause; all links are closed"),
    Transition("shut_down", ("off", "connected", "ready"), "off", "everything off, all links closed"),
    Transition(
        "shut_down",
        ("fault", "warming", "scanning", "paused", "suspended"),
        "fault",
        "everything off; in mid-work an emergency off; a fault stays latched",
    ),
)  # fmt: skip


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


def state_table() -> str:
    """Write states and transitions as Markdown tables."""
    lines = ["| state | meaning | verbs |", "|---|---|---|"]
    lines += [f"| `{s}` | {meaning} | {', '.join(allowed_verbs(s))} |" for s, meaning in STATES.items()]
    lines += ["", "| verb | from | to | when |", "|---|---|---|---|"]
    for t in TRANSITIONS:
        sources = "any state" if len(t.sources) == len(STATES) else ", ".join(t.sources)
        lines.append(f"| {t.verb} | {sources} | {t.target} | {t.meaning} |")
    return "\n".join(lines)
