"""What one run of the campaign came to, and what it had promised."""

from __future__ import annotations

from dataclasses import dataclass, field

from benchmarks.faults.cases import Case

DARK_S, DEAD_S = 0.050, 1.1  # after a driver's call has shown the fault; after the death of the host


@dataclass
class Result:
    """What one run came to.

    Attributes
    ----------
    case : Case
    state : str
        State of the controller at the end, before it is acknowledged or shut down.
    cause : str
        What `Controller.scan` or another verb raised, or the latched cause; empty when the run completed.
    lines, suspensions : int
        Lines stored; times that the scan waited.
    device_s : float
        Device time of the whole run.
    struck_s : float or None
        When the fault first took effect; None when nothing ever met it.
    fault_to_dark_s : float or None
        From then until the light was out; None where there was no light then.
    seen_to_dark_s : float or None
        From the moment at which a driver's call reported it until the light was out.
    off_verified : bool
        Whether the safe shutdown reported the laser verified off.
    lit : bool
        Whether there was light at the end, by the bench itself.
    lost, wrong : int
        Acknowledged lines that cannot be read; points marked good that are wrong.
    defect : str
        Anything else that must not happen: a hang, an unexpected kind of error, a fault without a cause.
    """

    case: Case
    state: str = ""
    cause: str = ""
    lines: int = 0
    suspensions: int = 0
    device_s: float = 0.0
    struck_s: float | None = None
    fault_to_dark_s: float | None = None
    seen_to_dark_s: float | None = None
    off_verified: bool = False
    lit: bool = False
    lost: int = 0
    wrong: int = 0
    defect: str = ""
    errors: list[tuple[float, str]] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Get whether all promises were kept."""
        return self.safe and self.in_time and not (self.lost or self.wrong or self.defect)

    @property
    def safe(self) -> bool:
        """Get whether there is no light and the host knows it; a dead host cannot."""
        return not self.lit and (self.off_verified or self.state == "off" or self.case.kind == "host_dead")

    @property
    def in_time(self) -> bool:
        """Get whether the light ended in time."""
        if self.case.kind == "host_dead":
            return (self.fault_to_dark_s or 0.0) <= DEAD_S
        return (self.seen_to_dark_s or 0.0) <= DARK_S
