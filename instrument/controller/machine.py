"""A typed thin wrapper over `transitions`: only verbs of the table, and a failed entry leads to ``fault``.

The library leaves the machine in the new state when a callback of that state raises; so entry actions are run
here, and an exception of theirs is turned into the ``fail`` transition explicitly.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from transitions import Machine as _Machine
from transitions import MachineError

from picoradar.instrument.controller.states import STATES, TRANSITIONS, State, allowed_verbs
from picoradar.instrument.errors import NotAllowed


class StateMachine:
    """The controller's state.

    Parameters
    ----------
    on_change : callable
        Called with (old state, new state, verb) after each change.
    """

    def __init__(self, on_change: Callable[[State, State, str], None]) -> None:
        self.state: State = "off"
        self.cause: str = ""
        self._on_change = on_change
        self._machine: Any = _Machine(
            model=self,
            states=list(STATES),
            initial="off",
            auto_transitions=False,
            transitions=[
                {"trigger": f"_do_{t.verb}", "source": list(t.sources), "dest": t.target} for t in TRANSITIONS
            ],
        )

    def check(self, verb: str) -> None:
        """Refuse a verb that the present state does not allow.

        Raises
        ------
        NotAllowed
            Naming what is allowed now.
        """
        if verb not in allowed_verbs(self.state) and verb != "fail":
            now = ", ".join(allowed_verbs(self.state)) or "nothing"
            because = f" ({self.cause})" if self.state == "fault" else ""
            raise NotAllowed(f"cannot {verb.replace('_', ' ')} in state '{self.state}'{because}; allowed now: {now}")

    def go(self, verb: str, enter: Callable[[], None] | None = None) -> None:
        """Carry out ``verb`` and then the entry action of the new state.

        Raises
        ------
        NotAllowed
            When the present state does not allow it.
        Exception
            What ``enter`` raised; the state is then ``fault`` and the cause is kept.
        """
        self.check(verb)
        old = self.state
        try:
            getattr(self, f"_do_{verb}")()
        except MachineError as error:
            raise NotAllowed(str(error)) from error
        self._on_change(old, self.state, verb)
        if enter is None:
            return
        try:
            enter()
        except BaseException as error:
            self.fail(f"{verb.replace('_', ' ')}: {error}")
            raise

    def fail(self, cause: str) -> None:
        """Latch the first cause and go to ``fault``."""
        if self.state != "fault":
            self.cause = cause
        self.go("fail")

    def clear(self) -> None:
        """Forget the cause, once it has been acknowledged."""
        self.cause = ""
