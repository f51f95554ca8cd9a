"""The commands that a scenario gives by itself, each at its step: what was done by hand, written down."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Protocol, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from dgu_sim.commands import AttackCommand, Command, known_command
from dgu_sim.errors import DguSimError
from dgu_sim.explain import part_of
from dgu_sim.model import Frozen, Number, check_keys, finding
from dgu_sim.signals import first_step

__all__ = ["CommandEvent", "Commands", "Script", "ScriptEntry", "Teller", "script_of"]

_WHEN = ("step", "at_sec")


class ScriptEntry(Frozen):
    """A command and its step; the fields of the command stand beside the other keys."""

    step: Annotated[int, Field(ge=0)] | None = Field(default=None, description="The step at which it acts; or:")
    at_sec: Annotated[Number, Field(ge=0)] | None = Field(default=None, description="The time [s].")
    command: str = Field(description="Name of the command.")
    fields: dict[str, object] = Field(default_factory=dict, exclude=True)

    @model_validator(mode="before")
    @classmethod
    def _gather_fields(cls, data: object) -> object:
        if not isinstance(data, dict) or "command" not in data:
            return data
        kind = known_command(data["command"])
        ours = (*_WHEN, "command")
        check_keys(data, [*ours, *kind.model_fields])
        fields = part_of(kind, {key: value for key, value in data.items() if key not in ours}).document()
        fields.pop("command")
        return {key: value for key, value in data.items() if key in ours} | {"fields": fields}

    @model_validator(mode="after")
    def _once(self) -> Self:
        if (self.step is None) == (self.at_sec is None):
            found = "neither" if self.step is None else "both"
            raise finding(("step",), self.step, f"expected either step or at_sec, found {found}")
        return self

    @model_serializer(mode="wrap")
    def _flat(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        ours = {key: value for key, value in handler(self).items() if value is not None}
        return {**ours, **self.fields}

    @property
    def order(self) -> Command:
        """The command."""
        return known_command(self.command).model_validate(self.fields)

    def at_step(self, sampling_period_sec: float) -> int:
        """Return the step at which it acts."""
        if self.step is not None:
            return self.step
        return first_step(self.at_sec or 0.0, sampling_period_sec)


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandEvent:
    """A command took effect.

    Attributes:
        step: The first step that it acts on.
        number: Number within the run, from 1; those on attacks, which the attacker tells, have numbers of their own.
        command: The command.
    """

    step: int
    number: int
    command: Command


class Commands(Protocol):
    """Where a run's commands come from: a script, or a person."""

    def due(self, step: int) -> Sequence[Command]:
        """Return the commands that act from a step on, in order; called once a step, before the step is made."""
        ...

    def refused(self, command: Command, error: DguSimError) -> None:
        """Hear that a command cannot be obeyed: nothing of it was done. What this raises ends the run."""
        ...


@dataclass(frozen=True, slots=True)
class Script:
    """Commands known before the run.

    Attributes:
        entries: Step and command; those of one step act in this order.
    """

    entries: tuple[tuple[int, Command], ...]
    _by_step: Mapping[int, Sequence[Command]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Sort by step."""
        by_step: dict[int, list[Command]] = {}
        for step, command in self.entries:
            by_step.setdefault(step, []).append(command)
        object.__setattr__(self, "_by_step", by_step)

    @property
    def by_step(self) -> Sequence[tuple[int, Command]]:
        """Step and command in the order in which a bag tells them: by step, those on attacks behind the others."""
        return sorted(self.entries, key=lambda one: (one[0], isinstance(one[1], AttackCommand)))

    def due(self, step: int) -> Sequence[Command]:
        """Return the commands of a step."""
        return self._by_step.get(step, ())

    def refused(self, command: Command, error: DguSimError) -> None:
        """Raise the error: a script is obeyed or is none."""
        del command
        raise error


def script_of(entries: Sequence[ScriptEntry], sampling_period_sec: float) -> Script:
    """Return the script of a scenario's section."""
    return Script(tuple((one.at_step(sampling_period_sec), one.order) for one in entries))


@dataclass(frozen=True, slots=True)
class Teller:
    """Numbers the commands of a run.

    Attributes:
        told: How many were told besides those on attacks.
        attacks: How many of those.
    """

    told: int = 0
    attacks: int = 0

    def event(self, step: int, command: Command) -> tuple["Teller", CommandEvent]:
        """Return the event of a command that acts from a step on, and who tells the next one."""
        if isinstance(command, AttackCommand):
            following = replace(self, attacks=self.attacks + 1)
            return following, CommandEvent(step=step, number=following.attacks, command=command)
        following = replace(self, told=self.told + 1)
        return following, CommandEvent(step=step, number=following.told, command=command)
