"""SCPI and IEEE 488.2 for simulated instruments: command tree, error queue, event register, sequential execution.

Commands are patterns such as ``:WAVeform:PREamble?``: the capitals are the short form, both forms are understood in
any case, and a header after ``;`` without a leading colon continues from the level of the previous one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

ERRORS_MAX = 20
NO_ERROR = '0,"No error"'
EVENT_OPERATION_COMPLETE = 0x01
EVENT_QUERY_ERROR = 0x04
EVENT_EXECUTION_ERROR = 0x10
EVENT_COMMAND_ERROR = 0x20
EVENT_POWER_ON = 0x80
MAV = 0x10
ESB = 0x20
MSS = 0x40

Handler = Callable[[list[str]], "str | bytes | None"]


class ScpiError(Exception):
    """A command is refused.

    Parameters
    ----------
    number : int
        SCPI error number: -1xx command, -2xx execution, -4xx query errors.
    text : str
    """

    def __init__(self, number: int, text: str) -> None:
        super().__init__(f'{number},"{text}"')
        self.number = number


class ScpiParser:
    """Executes program messages one command after the other.

    Parameters
    ----------
    commands : mapping of str to Handler
        Pattern to function; it takes the arguments and returns the answer of a query.

    Attributes
    ----------
    busy : bool
        While it is True no further command is begun; set it to False and call `run` to continue.
    headers : bool
        Whether answers begin with the header of their query.
    service_enable, event_enable : int
        Masks of ``*SRE`` and ``*ESE``.
    """

    def __init__(self, commands: Mapping[str, Handler]) -> None:
        self.busy = False
        self.headers = True
        self.service_enable = 0
        self.event_enable = 0
        self._handlers = [(_Pattern(pattern), handler) for pattern, handler in commands.items()]
        self._messages: deque[str] = deque()
        self._units: deque[str] = deque()
        self._place: list[str] = []
        self._parts: list[bytes] = []
        self._output: bytes | None = None
        self._errors: deque[str] = deque()
        self._events = EVENT_POWER_ON

    @property
    def output(self) -> bytes | None:
        """Get the answer that waits for the host, LF included."""
        return self._output

    @output.setter
    def output(self, rest: bytes | None) -> None:
        self._output = rest or None

    @property
    def status_byte(self) -> int:
        """Get the status byte: message available, event summary, service requested."""
        status = (MAV if self._output else 0) | (ESB if self._events & self.event_enable else 0)
        return status | (MSS if status & self.service_enable else 0)

    def execute(self, message: bytes) -> None:
        """Take a program message."""
        self._messages.append(message.decode("ascii", "replace").strip())
        self.run()

    def run(self) -> None:
        """Execute what has been taken, until a command makes the instrument busy."""
        while not self.busy:
            if not self._units:
                self._finish_message()
                if not self._messages:
                    return
                self._begin_message(self._messages.popleft())
                continue
            unit = self._units.popleft()
            try:
                answer = self._unit(unit)
            except ScpiError as error:
                self.report(error)
                continue
            if answer is not None:
                self._parts.append(answer)

    def clear(self) -> None:
        """Discard messages and answers (device clear)."""
        self._messages.clear()
        self._units.clear()
        self._parts.clear()
        self._output = None
        self.busy = False

    def report(self, error: ScpiError) -> None:
        """Queue an error and set its bit in the event register."""
        if len(self._errors) < ERRORS_MAX:
            self._errors.append(str(error))
        else:
            self._errors[-1] = '-350,"Queue overflow"'
        group = -error.number // 100
        bits = {1: EVENT_COMMAND_ERROR, 2: EVENT_EXECUTION_ERROR, 4: EVENT_QUERY_ERROR}
        self._events |= bits.get(group, 0)

    def complete(self) -> None:
        """Set the bit of ``*OPC`` in the event register."""
        self._events |= EVENT_OPERATION_COMPLETE

    def pop_error(self) -> str:
        """Take the oldest error."""
        return self._errors.popleft() if self._errors else NO_ERROR

    def pop_events(self) -> int:
        """Read the event register, which clears it."""
        events, self._events = self._events, 0
        return events

    def clear_status(self) -> None:
        """Empty error queue and event register (``*CLS``)."""
        self._errors.clear()
        self._events = 0

    def _begin_message(self, message: str) -> None:
        if self._output is not None:
            self._output = None
            self.report(ScpiError(-410, "Query INTERRUPTED"))
        self._place = []
        self._units.extend(unit.strip() for unit in message.split(";") if unit.strip())

    def _finish_message(self) -> None:
        if self._parts:
            self._output = b";".join(self._parts) + b"\n"
            self._parts = []

    def _unit(self, unit: str) -> bytes | None:
        header, _, rest = unit.partition(" ")
        words = header.lstrip(":").split(":")
        if not header.startswith((":", "*")):
            words = self._place + words
        found = next(((p, handler) for p, handler in self._handlers if p.matches(words)), None)
        if found is None:
            raise ScpiError(-113, f"Undefined header; {header}")
        pattern, handler = found
        if not header.startswith("*"):
            self._place = words[:-1]
        answer = handler([argument.strip() for argument in rest.split(",")] if rest.strip() else [])
        if answer is None:
            return None
        raw = answer if isinstance(answer, bytes) else answer.encode("ascii")
        if self.headers and not header.startswith("*"):
            raw = pattern.long_form.encode("ascii") + b" " + raw
        return raw


class _Pattern:
    """Header of a command in short and long form."""

    def __init__(self, pattern: str) -> None:
        words = pattern.lstrip(":").split(":")
        self._words = [{word.upper(), "".join(c for c in word if not c.islower())} for word in words]
        self.long_form = ":" + ":".join(word.upper() for word in words).rstrip("?")

    def matches(self, words: list[str]) -> bool:
        return len(words) == len(self._words) and all(
            word.upper() in forms for word, forms in zip(words, self._words, strict=True)
        )


def number(arguments: list[str], minimum: float, maximum: float) -> float:
    """Get the one number of a command.

    Parameters
    ----------
    arguments : list of str
    minimum, maximum : float

    Raises
    ------
    ScpiError
    """
    text = only(arguments)
    try:
        value = float(text)
    except ValueError as error:
        raise ScpiError(-104, f"Data type error; {text}") from error
    if not minimum <= value <= maximum:
        raise ScpiError(-222, f"Data out of range; {text}")
    return value


def choice(arguments: list[str], forms: Mapping[str, str]) -> str:
    """Get the one word of a command in its short form.

    Parameters
    ----------
    forms : mapping of str to str
        Long form to short form, in capitals.

    Raises
    ------
    ScpiError
    """
    text = only(arguments).upper()
    for long_form, short_form in forms.items():
        if text in (long_form, short_form):
            return short_form
    raise ScpiError(-224, f"Illegal parameter value; {text}")


def only(arguments: list[str]) -> str:
    """Get the one argument of a command.

    Raises
    ------
    ScpiError
    """
    if not arguments:
        raise ScpiError(-109, "Missing parameter")
    if len(arguments) > 1:
        raise ScpiError(-108, "Parameter not allowed")
    return arguments[0]
