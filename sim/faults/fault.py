"""`Fault`: one thing that goes wrong, when, where and how, as data."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Link = Literal["dg645", "genesys", "tec", "helios", "bridge", "bench"]
SERIAL: tuple[Link, ...] = ("dg645", "genesys", "tec")
USB: tuple[Link, ...] = ("helios", "bridge")
BENCH: tuple[Link, ...] = ("bench",)


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class At(_Part):
    """When a fault is injected; exactly one of the four."""

    time_s: float | None = Field(None, ge=0, description="from this moment on the bench's clock, s")
    command: int | None = Field(None, ge=1, description="at the n-th message on the link")
    pulse: int | None = Field(None, ge=1, description="once so many laser shots have been sampled")
    probability: float | None = Field(None, gt=0, le=1, description="at each message, with this probability")

    @model_validator(mode="after")
    def _one_of_four(self) -> At:
        given = [v for v in (self.time_s, self.command, self.pulse, self.probability) if v is not None]
        if len(given) != 1:
            raise ValueError("give exactly one of time_s, command, pulse, probability")
        return self


class Fault(_Part):
    """One declared fault.

    Attributes
    ----------
    kind : str
        A key of `picoradar.sim.faults.KINDS`.
    link : str
        Link that it affects; ``bench`` for the physics.
    at : At
    lasts_s : float, optional
        How long it lasts; without it, for good (a state) or for ``count`` messages.
    count : int, optional
        How many messages it affects; without it, one, or all while it lasts.
    parameters : dict
        Parameters of the kind.
    """

    kind: str
    link: Link = "bench"
    at: At
    lasts_s: float | None = Field(None, gt=0)
    count: int | None = Field(None, ge=1)
    parameters: dict[str, float] = Field(default_factory=dict)

    def as_dict(self) -> dict[str, object]:
        """Get the declaration as plain data, for the header of a recording."""
        return self.model_dump(exclude_none=True)
