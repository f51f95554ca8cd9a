"""What a person may tell a running system: one frozen model a command, the same in a script, a service and a page."""

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Self, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError, model_validator

from dgu_sim.attacks import KINDS, expected_class
from dgu_sim.errors import AttackError, SteeringError
from dgu_sim.explain import explain, part_of
from dgu_sim.grid import Link
from dgu_sim.matrices import STATES
from dgu_sim.model import Frozen, Number, finding
from dgu_sim.suggestions import meant

__all__ = [
    "COMMANDS",
    "AttackChange",
    "AttackCommand",
    "AttackStart",
    "AttackStop",
    "ClockPause",
    "ClockRate",
    "ClockResume",
    "ClockStep",
    "Command",
    "DetectorCommand",
    "DetectorOff",
    "DetectorOn",
    "DetectorRecalibrate",
    "DetectorThreshold",
    "DguCommand",
    "LoadRamp",
    "LoadSet",
    "LoadStep",
    "ReferenceSet",
    "ResponseCommand",
    "ResponseOff",
    "ResponseOn",
    "known_command",
    "parse_command",
    "unknown_place",
]


def _link(value: object) -> object:
    if isinstance(value, str):
        try:
            Link.parse(value)
        except AttackError:
            raise finding((), value, "expected SOURCE-TARGET, like 1-2") from None
    return value


def _one_or_each(value: tuple[float, ...] | float) -> tuple[float, ...] | float:
    if isinstance(value, tuple) and len(value) not in {1, STATES}:
        raise finding((), list(value), f"expected one number, or {STATES}: V [V], I_t [A], v [V s]")
    return value


def _plain(value: object) -> str:
    if isinstance(value, list):
        return " ".join(_plain(one) for one in value)
    if isinstance(value, dict):
        return " ".join(f"{key} {_plain(one)}" for key, one in value.items())
    return f"{value:g}" if isinstance(value, float) else str(value)


LinkName = Annotated[str, BeforeValidator(_link)]
Positive = Annotated[Number, Field(gt=0)]
Threshold = Annotated[Number, Field(ge=0)]


class Command(Frozen):
    """A command; its fields are what `parse_command` takes beside its name."""

    name: ClassVar[str] = ""

    def document(self) -> dict[str, object]:
        """Return its name and fields as plain data, as it stands in a script: `parse_command` reads it back."""
        return {"command": self.name, **self.model_dump(mode="json", exclude_defaults=True)}

    @property
    def words(self) -> str:
        """What it says, in one line: "load step: dgu 2, current_a 1"."""
        fields = self.document()
        fields.pop("command")
        text = ", ".join(f"{key} {_plain(value)}" for key, value in fields.items())
        return f"{self.name.replace('_', ' ')}: {text}" if text else self.name.replace("_", " ")

    @property
    def named_dgus(self) -> tuple[int, ...]:
        """The DGUs that it names itself."""
        dgu = getattr(self, "dgu", None)
        return () if dgu is None else (dgu,)

    @property
    def named_links(self) -> tuple[Link, ...]:
        """The links that it names, in order."""
        names = (*getattr(self, "links", ()), getattr(self, "link", None))
        return tuple(Link.parse(one) for one in names if one is not None)


class ClockPause(Command):
    """Stand still behind the step that was released last."""

    name = "clock_pause"


class ClockResume(Command):
    """Go on."""

    name = "clock_resume"


class ClockStep(Command):
    """Go on by so many steps, and stand still."""

    name = "clock_step"
    steps: int = Field(default=1, ge=1, le=1_000_000_000, description="How many steps.")


class ClockRate(Command):
    """Keep pace with the wall clock from here on."""

    name = "clock_rate"
    rate: Positive | None = Field(description="Factor of real time; none: as fast as the machine goes.")


class DguCommand(Command):
    """Acts on one DGU."""

    dgu: int = Field(ge=1, description="Number of the DGU.")


class LoadSet(DguCommand):
    """I_L = current_a from this step on, whatever the scenario's loads would draw."""

    name = "load_set"
    current_a: Number = Field(description="Current drawn [A].")


class LoadStep(DguCommand):
    """current_a more from this step on."""

    name = "load_step"
    current_a: Number = Field(description="Current added [A]; negative to take load away.")


class LoadRamp(DguCommand):
    """More and more from this step on, current_a more ramp_sec later and from then on."""

    name = "load_ramp"
    current_a: Number = Field(description="Current added in the end [A].")
    ramp_sec: Positive = Field(description="How long it rises [s].")


class ReferenceSet(DguCommand):
    """V_ref = voltage_v from this step on; secondary control adds its correction to it."""

    name = "reference_set"
    voltage_v: Number = Field(description="Voltage reference [V].")


class DetectorCommand(Command):
    """Acts on the detector of one link, or of all links into one DGU."""

    link: LinkName | None = Field(default=None, description='The watched link, "SOURCE-TARGET"; or:')
    dgu: int | None = Field(default=None, ge=1, description="The DGU whose incoming links are meant, all of them.")

    @model_validator(mode="after")
    def _either(self) -> Self:
        if (self.link is None) == (self.dgu is None):
            found = "neither" if self.link is None else "both"
            raise finding(("link",), self.link, f"expected either link or dgu, found {found}")
        return self

    @property
    def monitor(self) -> int:
        """The DGU whose monitor is meant."""
        return self.named_links[0].target if self.named_links else self.named_dgus[0]


class DetectorThreshold(DetectorCommand):
    """Judge |r_i| > threshold_i from this step on, instead of what the detector itself would say."""

    name = "detector_threshold"
    threshold: Annotated[tuple[Threshold, ...] | Threshold, AfterValidator(_one_or_each)] = Field(
        description="One number for all components of the residual, or one each [V, A, V s]."
    )

    @property
    def limits(self) -> tuple[float, ...]:
        """One number, or one for each component."""
        return self.threshold if isinstance(self.threshold, tuple) else (self.threshold,)


class DetectorRecalibrate(DetectorCommand):
    """Begin again: settle, learn and judge as at the start of the run; a threshold set by hand is forgotten."""

    name = "detector_recalibrate"


class DetectorOn(DetectorCommand):
    """Judge again."""

    name = "detector_on"


class DetectorOff(DetectorCommand):
    """Judge nothing until switched on: no alarm, no threshold."""

    name = "detector_off"


class ResponseCommand(Command):
    """Acts on the response of one DGU, or of all."""

    dgu: int | None = Field(default=None, ge=1, description="The DGU; default: all.")


class ResponseOn(ResponseCommand):
    """Leave accused links out of secondary control again."""

    name = "response_on"


class ResponseOff(ResponseCommand):
    """Leave no link out of secondary control."""

    name = "response_off"


class AttackCommand(Command):
    """Acts on the attacker, who tells of it on `/attacks/commands`; of all others the clock does."""


class AttackStart(AttackCommand):
    """Start an attack from this step on, or later."""

    name = "attack_start"
    kind: str = Field(description="Name of the attack class.")
    links: tuple[LinkName, ...] = Field(min_length=1, description="The attacked links, in their order.")
    parameters: dict[str, object] = Field(default_factory=dict, description="Parameters of the attack class.")
    duration_sec: Annotated[Number, Field(ge=0)] = Field(default=0.0, description="Length [s]; 0: until stopped.")
    start_sec: Annotated[Number, Field(ge=0)] | None = Field(
        default=None, description="Time of the first affected sample [s]; default: this step."
    )
    anyway: bool = Field(default=False, description="Start even while the detectors learn from attack-free samples.")

    @model_validator(mode="after")
    def _checked(self) -> Self:
        if self.kind not in KINDS:
            raise finding(("kind",), self.kind, expected_class(self.kind))
        attack = part_of(KINDS[self.kind], self.parameters)
        if len(set(self.links)) < len(self.links):
            raise finding(("links",), list(self.links), "expected different links")
        try:
            attack.check_links(self.named_links)
        except AttackError as error:
            raise finding(("links",), list(self.links), str(error)) from None
        return self


class AttackChange(AttackStart):
    """Stop every attack that is active on the first link, and start this one, with no sample between."""

    name = "attack_change"


class AttackStop(AttackCommand):
    """Stop every attack that is active on a link."""

    name = "attack_stop"
    link: LinkName = Field(description="The attacked link.")


_CLASSES: tuple[type[Command], ...] = (
    *(ClockPause, ClockResume, ClockStep, ClockRate),
    *(LoadSet, LoadStep, LoadRamp, ReferenceSet),
    *(DetectorThreshold, DetectorRecalibrate, DetectorOn, DetectorOff, ResponseOn, ResponseOff),
    *(AttackStart, AttackChange, AttackStop),
)
COMMANDS: Mapping[str, type[Command]] = {one.name: one for one in _CLASSES}
"""All commands by name."""

Plain: TypeAlias = Mapping[str, object]


def known_command(name: object) -> type[Command]:
    """Return the class of a command; raises what `dgu_sim.model.finding` returns when there is none."""
    if not isinstance(name, str) or name not in COMMANDS:
        expected = f"expected one of {', '.join(COMMANDS)}; {meant(name, COMMANDS)}".removesuffix("; ")
        raise finding(("command",), name, expected)
    return COMMANDS[name]


def parse_command(data: Plain) -> Command:
    """Return a command from plain data: "command", its name, beside its fields.

    Args:
        data: As `Command.document` returns it.

    Raises:
        SteeringError: One line with what is wrong: key, value and what was expected.
    """
    fields = {key: value for key, value in data.items() if key != "command"}
    name = data.get("command")
    if not isinstance(name, str) or name not in COMMANDS:
        near = meant(name, COMMANDS)
        raise SteeringError(f"command = {name!r}: expected one of {', '.join(COMMANDS)}; {near}".removesuffix("; "))
    try:
        return COMMANDS[name].model_validate(fields)
    except ValidationError as error:
        raise SteeringError(f"{name}: {explain(error, fields)}") from error


def unknown_place(command: Command, dgus: Sequence[int], links: Sequence[Link]) -> tuple[str, str, str] | None:
    """Return key, value and what was expected of the first DGU or link of a command that the grid does not have."""
    for dgu in command.named_dgus:
        if dgu not in dgus:
            return "dgu", str(dgu), f"expected one of the DGUs {', '.join(map(str, dgus))}"
    for link in command.named_links:
        if link not in links:
            known = ", ".join(map(str, links)) or "none: the scenario has no lines"
            return "links" if isinstance(command, AttackStart) else "link", str(link), f"expected a link: {known}"
    return None
