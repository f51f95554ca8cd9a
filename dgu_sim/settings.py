"""The sections of a scenario file; `dgu_sim.scenario` puts them together."""

from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import (
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticCustomError

from dgu_sim.attacks import KINDS, Attack, expected_class
from dgu_sim.errors import PlugInError
from dgu_sim.excitation import Excitation, UniformExcitation
from dgu_sim.explain import part_of
from dgu_sim.grid import Link
from dgu_sim.loads import Load
from dgu_sim.model import Frozen, Number, Spread3, Vector3, check_keys, finding
from dgu_sim.parameters import DguParameters
from dgu_sim.relay import AttackPlan

__all__ = [
    "Accept",
    "AttackSettings",
    "DguSettings",
    "HistoryPlant",
    "HistorySettings",
    "LineSettings",
    "Precision",
    "ReceiverSettings",
    "SecondarySettings",
]

Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]


def _state(value: object) -> object:
    if value != "equilibrium" and not (isinstance(value, list | tuple) and len(value) == 3):  # noqa: PLR2004 - V, I_t, v
        raise PydanticCustomError("state", "expected equilibrium or 3 numbers: V [V], I_t [A], v [V s]")
    return value


def _pair(value: object) -> object:
    if not isinstance(value, list | tuple) or len(value) != 2:  # noqa: PLR2004 - a line has two ends
        raise PydanticCustomError("pair", "expected two DGU numbers, like [1, 2]")
    return value


InitialState = Annotated[Literal["equilibrium"] | Vector3, BeforeValidator(_state)]
Pair = Annotated[tuple[int, int], BeforeValidator(_pair)]


class OutputComponent(StrEnum):
    """Components of a DGU's measured output, in the order of the output vector."""

    V = "V"
    I_T = "I_t"
    INTEGRATOR = "v"


class DguSettings(Frozen):
    """One distributed generation unit."""

    id: int = Field(ge=1, description="Number of the DGU; ids ascend through the list.")
    resistance_ohm: Positive = Field(description="R_t of the output filter [ohm].")
    inductance_h: Positive = Field(description="L_t of the output filter [H].")
    capacitance_f: Positive = Field(description="C_t at the bus [F].")
    k1: Number = Field(description="Primary gain of the bus voltage; k1 < 1.")
    k2: Number = Field(description="Primary gain of the filter current [ohm]; k2 < R_t.")
    k3: Number = Field(description="Primary gain of the integrator [1/s]; 0 < k3 < (k1 - 1)(k2 - R_t)/L_t.")
    reference_v: Number = Field(description="V_ref, the voltage reference [V].")
    rated_current_a: Positive = Field(default=1.0, description="I^r [A]: secondary control makes I/I^r equal.")
    load: tuple[Load, ...] = Field(default=(), description="Loads; their currents add up.")
    initial_state: InitialState = Field(
        default="equilibrium",
        description="State at step 0: V [V], I_t [A], v [V s], or the coupled grid's equilibrium.",
    )
    initial_spread: Spread3 = Field(
        default=(0.0, 0.0, 0.0), description="Half-widths of a uniform random spread added to initial_state."
    )

    output: tuple[OutputComponent, ...] = Field(
        default=tuple(OutputComponent),
        min_length=1,
        description="Components of the output that neighbours are sent.",
    )

    @field_validator("output")
    @classmethod
    def _each_once(cls, output: tuple[OutputComponent, ...]) -> tuple[OutputComponent, ...]:
        if len(set(output)) != len(output):
            raise finding((), [one.value for one in output], "expected each component at most once")
        return output

    @property
    def sent(self) -> tuple[bool, ...]:
        """Whether V, I_t and v are sent."""
        return tuple(component in self.output for component in OutputComponent)

    @model_validator(mode="after")
    def _gain_condition(self) -> Self:
        violation = self.parameters.gain_violation()
        if violation is not None:
            raise finding((violation[0],), getattr(self, violation[0]), f"expected {violation[1]}")
        return self

    @property
    def parameters(self) -> DguParameters:
        """The parameters by the symbols of the papers."""
        return DguParameters(
            R_t=self.resistance_ohm,
            L_t=self.inductance_h,
            C_t=self.capacitance_f,
            k1=self.k1,
            k2=self.k2,
            k3=self.k3,
        )

    @property
    def nominal_load(self) -> float:
        """Mean load current at t = 0 [A]."""
        return sum((one.nominal() for one in self.load), 0.0)


class Accept(StrEnum):
    """Which of two messages of the same step a receiver takes."""

    NEWEST = "newest"
    KNOWN_PUBLISHER = "known_publisher"


class ReceiverSettings(Frozen):
    """What every DGU makes of the messages on its incoming links."""

    accept: Accept = Field(
        default=Accept.NEWEST,
        description="Of two messages of the same step: the newest, or the one of the publisher known since step 0.",
    )


class LineSettings(Frozen):
    """A power line; communication runs along it in both directions."""

    between: Pair = Field(description="The two DGUs it joins.")
    resistance_ohm: Positive = Field(description="R_ij [ohm].")
    inductance_h: NonNegative = Field(
        default=0.0, description="L_ij [H]; lines are quasi-stationary, L/R << T_s is checked."
    )


class SecondarySettings(Frozen):
    """Secondary consensus control."""

    enabled: bool = Field(default=True, description="Whether it runs.")
    gain: Positive = Field(default=0.1, description="k_I [V/s for a difference of 1 in I/I^r].")


class HistoryPlant(StrEnum):
    """Which plant the offline experiment is recorded on."""

    OWN = "own"
    JOINT = "joint"


class Precision(StrEnum):
    """Number format of a recorded history."""

    FLOAT32 = "float32"
    FLOAT64 = "float64"


class HistorySettings(Frozen):
    """The offline experiment that the monitors learn a DGU from (T, section V)."""

    samples: int = Field(default=20, ge=2, description="T: samples of one experiment.")
    experiments: int = Field(default=1, ge=1, description="How many experiments, side by side.")
    plant: HistoryPlant = Field(
        default=HistoryPlant.OWN,
        description="own: the DGU with its own lines, others as unknown input; joint: the jointly integrated grid.",
    )
    state_spread: Spread3 = Field(default=(1.0, 1.0, 1.0), description="x(0) ~ U(-s, s) for V [V], I_t [A], v [V s].")
    load_spread_a: NonNegative = Field(
        default=1.0, description="I_L ~ operating value + U(-s, s), new each sample [A]."
    )
    reference_spread_v: NonNegative = Field(
        default=1.0, description="V_ref ~ reference_v + U(-s, s), new each sample [V]."
    )
    voltage_spread_v: NonNegative = Field(
        default=1.0, description="Neighbour voltages ~ their reference_v + U(-s, s), new each sample [V]."
    )
    excitation: Excitation = Field(
        default_factory=UniformExcitation, description="How load, reference and neighbour voltages move within that."
    )
    noise_std: NonNegative = Field(
        default=0.0, description="Standard deviation of Gaussian noise on every recorded number."
    )
    precision: Precision = Field(default=Precision.FLOAT64, description="Number format the record is rounded to.")
    bag: str | None = Field(
        default=None,
        description="Bag with recorded histories, beside the scenario file: the experiment is not run, "
        "and the keys above are not used.",
    )


_EITHER = ("link", "links")


class AttackSettings(Frozen):
    """An attack on one or several links; the parameters of its class stand beside the other keys."""

    kind: str = Field(description="Name of the attack class.")
    link: str | None = Field(default=None, description='The attacked link, "SOURCE-TARGET"; or:')
    links: tuple[str, ...] | None = Field(
        default=None, min_length=1, description="The attacked links, of an attack that acts on several together."
    )
    start_sec: NonNegative = Field(description="Time of the first affected sample [s].")
    stop_sec: Number | None = Field(default=None, description="Time of the first clean sample [s]; default: never.")
    parameters: dict[str, object] = Field(default_factory=dict, exclude=True)

    @model_validator(mode="before")
    @classmethod
    def _gather_parameters(cls, data: object) -> object:
        """Split the keys into our own and those of the attack class, and let the class check its own."""
        if not isinstance(data, dict) or not isinstance(data.get("kind"), str):
            return data
        if data["kind"] not in KINDS:
            raise finding(("kind",), data["kind"], expected_class(data["kind"]))
        ours = [key for key in cls.model_fields if key != "parameters"]
        try:
            attack = KINDS[data["kind"]]
        except PlugInError as error:
            raise finding(("kind",), data["kind"], str(error)) from error
        check_keys(data, [*ours, *attack.model_fields])
        given = {key: value for key, value in data.items() if key not in ours}
        parameters = part_of(attack, given).model_dump(mode="json")
        return {key: value for key, value in data.items() if key in ours} | {"parameters": parameters}

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if (self.link is None) == (self.links is None):
            found = "no link" if self.link is None else "link and links"
            raise finding(("link",), self.link, f"expected either link or links, found {found}")
        if self.stop_sec is not None and self.stop_sec <= self.start_sec:
            raise finding(("stop_sec",), self.stop_sec, f"expected a time after start_sec = {self.start_sec:g}")
        return self

    @model_serializer(mode="wrap")
    def _flat(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        ours = {key: value for key, value in handler(self).items() if key not in _EITHER or value is not None}
        return {**ours, **self.parameters}

    @property
    def link_names(self) -> tuple[str, ...]:
        """The attacked links as the file names them."""
        return self.links if self.links is not None else (str(self.link),)

    @property
    def attack(self) -> Attack:
        """The attack with its parameters."""
        return KINDS[self.kind].model_validate(self.parameters)

    @property
    def plan(self) -> AttackPlan:
        """What the relay schedules."""
        return AttackPlan(
            links=tuple(Link.parse(name) for name in self.link_names),
            kind=self.kind,
            parameters=self.parameters,
            start_sec=self.start_sec,
            stop_sec=self.stop_sec,
        )
