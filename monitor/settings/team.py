"""What monitors are told that estimate the whole grid together."""

from enum import StrEnum
from typing import Annotated, Self

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from monitor.settings.base import NonNegative, Number, Settings, Spread3, Vector3, finding

__all__ = ["AnnouncedInput", "TeamEventKind", "TeamEventSettings", "TeamSettings", "TeamStructure"]


class TeamStructure(StrEnum):
    """Who corrects its estimate by its own outputs, and who listens."""

    MUTUAL = "mutual"
    LEADER = "leader"


class AnnouncedInput(StrEnum):
    """Inputs of a DGU, in the order of the input vector."""

    LOAD = "load"
    REFERENCE = "reference"


class TeamEventKind(StrEnum):
    """What a member does."""

    JOINS = "joins"
    LEAVES = "leaves"
    LIES = "lies"


def _pair(value: object) -> object:
    if not isinstance(value, list | tuple) or len(value) != 2:  # noqa: PLR2004 - two members exchange estimates
        raise PydanticCustomError("pair", "expected two DGU numbers, like [1, 2]")
    return value


Pair = Annotated[tuple[int, int], BeforeValidator(_pair)]


class TeamEventSettings(Settings):
    """A member joins late, leaves, or lies for a while."""

    member: int = Field(description="Number of the DGU that hosts the member.")
    kind: TeamEventKind = Field(description="joins (absent until then), leaves, or lies.")
    start_sec: NonNegative = Field(description="Time of the first step that is affected [s].")
    stop_sec: Number | None = Field(default=None, description="lies: time of the first true estimate [s]; none: never.")
    bias: Vector3 | None = Field(
        default=None, description="lies: what it adds to V [V], I_t [A], v [V s] of every DGU that it tells."
    )

    @model_validator(mode="after")
    def _fits_the_kind(self) -> Self:
        lies = self.kind is TeamEventKind.LIES
        if lies != (self.bias is not None):
            raise finding(("bias",), self.bias, f"expected {'3 numbers for' if lies else 'no bias for'} {self.kind}")
        if self.stop_sec is not None and (not lies or self.stop_sec <= self.start_sec):
            expected = f"expected a time after start_sec = {self.start_sec:g}" if lies else "expected it for lies alone"
            raise finding(("stop_sec",), self.stop_sec, expected)
        return self


class TeamSettings(Settings):
    """Every monitor estimates the whole grid and exchanges its estimate with its neighbours in the team."""

    structure: TeamStructure = Field(
        default=TeamStructure.MUTUAL,
        description="mutual: every member corrects itself and listens; leader: D's Theorem 1, one corrects itself.",
    )
    leader: int | None = Field(
        default=None, description="The leading member, with structure leader; none: the first that may lead."
    )
    coupling: Annotated[Number, Field(gt=0)] | None = Field(
        default=None, description="chi, the pull towards neighbours' estimates; none: the fastest of a search."
    )
    links: tuple[Pair, ...] | None = Field(
        default=None, description="Pairs of members that exchange estimates; none: along the lines."
    )
    announced: tuple[AnnouncedInput, ...] = Field(
        default=tuple(AnnouncedInput), description="Inputs of a DGU that members who do not hear it are told."
    )
    samples: int = Field(default=120, ge=2, description="Samples of the experiment on the whole grid.")
    settle_sec: NonNegative = Field(default=2.0, description="Time a disagreement is given to die out [s].")
    calibrate_sec: NonNegative = Field(
        default=2.0, description="Length of the honest stretch after that, which thresholds are learned from [s]."
    )
    margin: Annotated[Number, Field(gt=0)] = Field(
        default=5.0, description="Threshold = margin x largest disagreement of that stretch."
    )
    floor: Spread3 = Field(default=(0.05, 0.2, 0.002), description="Smallest threshold on V [V], I_t [A], v [V s].")
    isolate: bool = Field(default=True, description="Whether accused members are left out of the sums.")
    events: tuple[TeamEventSettings, ...] = Field(default=(), description="Who joins, leaves and lies.")
