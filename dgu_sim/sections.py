"""The sections of a scenario, and what follows from them."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator
from pydantic_core import PydanticCustomError

from dgu_sim.errors import ScenarioError
from dgu_sim.explain import listed, part_of
from dgu_sim.generate import generated
from dgu_sim.grid import Grid, Line, Link, links_of
from dgu_sim.grid_settings import GridSettings
from dgu_sim.model import Frozen, Number, finding
from dgu_sim.noise import Noise, NoNoise
from dgu_sim.plant import Coupling
from dgu_sim.poison import Poison
from dgu_sim.script import Script, ScriptEntry, script_of
from dgu_sim.settings import (
    AttackSettings,
    DguSettings,
    HistorySettings,
    LineSettings,
    ReceiverSettings,
    SecondarySettings,
)

__all__ = ["Sections"]

_LISTED = ("dgus", "lines")
_DERIVED = ("grid", "links", "_positions")


class _GridPart(Frozen):
    """The section `grid` alone: DGUs and lines are made from it before anything else is looked at."""

    grid: GridSettings


class Sections(Frozen):
    """Grid, control, noise, attacks and monitors of a run, each checked by itself; `Scenario` checks them together."""

    name: str = Field(min_length=1, description="Short name; bags and reports carry it.")
    description: str = Field(default="", description="What it shows and where its numbers come from.")
    seed: int = Field(default=1, ge=0, description="Seed of every random number of the run.")
    sampling_period_sec: Number = Field(default=0.01, ge=1e-6, le=10.0, description="T_s [s].")
    duration_sec: Number = Field(default=10.0, gt=0, description="Length of the run [s].")
    coupling: Coupling = Field(
        default=Coupling.HELD,
        description="isolated (no lines), held (neighbour voltages held over a sample) or joint (integrated together).",
    )
    generator: GridSettings | None = Field(
        default=None, alias="grid", description="A grid that is generated, in place of dgus and lines."
    )
    dgus: tuple[DguSettings, ...] = Field(min_length=1, description="The DGUs.")
    lines: tuple[LineSettings, ...] = Field(default=(), description="The lines, which are the communication links too.")
    secondary: SecondarySettings = Field(default_factory=SecondarySettings, description="Secondary control.")
    noise: Noise = Field(default_factory=NoNoise, description="Measurement noise of every DGU.")
    history: HistorySettings = Field(default_factory=HistorySettings, description="The offline experiment.")
    receiver: ReceiverSettings = Field(
        default_factory=ReceiverSettings, description="What a DGU makes of the messages on its links."
    )
    poison: tuple[Poison, ...] = Field(default=(), description="What attackers do to histories before they are read.")
    monitor: dict[str, object] = Field(
        default_factory=dict, description="What the monitors run; they check it (`bags.watch.scenarios`)."
    )
    attacks: tuple[AttackSettings, ...] = Field(default=(), description="Attacks that the scenario schedules.")
    script: tuple[ScriptEntry, ...] = Field(default=(), description="Commands, each at its step.")

    @property
    def orders(self) -> Script:
        """The commands of the script by their steps."""
        return script_of(self.script, self.sampling_period_sec)

    @model_validator(mode="before")
    @classmethod
    def _generate(cls, data: object) -> object:
        """Make DGUs and lines of a grid that is to be generated."""
        if not isinstance(data, Mapping) or data.get("grid") is None:
            return data
        for key in _LISTED:
            if key in data:
                raise finding((key,), data[key], f"expected either grid, which makes them, or {key}")
        settings = part_of(_GridPart, {"grid": data["grid"]}).grid
        try:
            dgus, lines = generated(settings)
        except PydanticCustomError as error:
            found = error.context or {}
            raise finding(("grid", *found["key"]), found["value"], found["expected"]) from None
        return {**data, "grid": settings, "dgus": dgus, "lines": lines}

    @model_serializer(mode="wrap")
    def _as_written(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out what is generated, or that nothing is, and a script that is none: as before there were any."""
        left_out = () if self.script else ("script",)
        if self.generator is None:
            return {key: value for key, value in handler(self).items() if key not in ("generator", *left_out)}
        parts = handler(self.model_copy(update={"generator": self.generator, "dgus": (), "lines": ()}))
        kept = {key: value for key, value in parts.items() if key not in (*_LISTED, *left_out)}
        return {"grid" if key == "generator" else key: value for key, value in kept.items()}

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with other values; what follows from them is worked out anew."""
        changes = dict(update or {})
        if not changes.keys().isdisjoint(_LISTED):
            changes.setdefault("generator", None)
        copied = super().model_copy(update=changes, deep=deep)
        for name in _DERIVED:
            copied.__dict__.pop(name, None)
        return copied

    @property
    def steps(self) -> int:
        """Number of steps: messages k = 0 ... steps-1."""
        return max(1, round(self.duration_sec / self.sampling_period_sec))

    @property
    def sampling_period_ns(self) -> int:
        """T_s in whole nanoseconds: the stamp of step k is k times this."""
        return round(self.sampling_period_sec * 1e9)

    @cached_property
    def grid(self) -> Grid:
        """Topology and parameters."""
        return Grid(
            dgus=tuple(dgu.id for dgu in self.dgus),
            parameters={dgu.id: dgu.parameters for dgu in self.dgus},
            lines=tuple(Line(between=line.between, resistance_ohm=line.resistance_ohm) for line in self.lines),
        )

    @cached_property
    def links(self) -> tuple[Link, ...]:
        """Directed communication links, by target, then source: the order of every array axis "links"."""
        return links_of([line.between for line in self.lines])

    def dgu(self, number: int) -> DguSettings:
        """Return the settings of one DGU.

        Raises:
            ScenarioError: There is no such DGU.
        """
        position = self._positions.get(number)
        if position is None:
            raise ScenarioError(f"DGU {number}: expected one of {listed([dgu.id for dgu in self.dgus])}")
        return self.dgus[position]

    @cached_property
    def _positions(self) -> Mapping[int, int]:
        """Place of each DGU by its number."""
        return {dgu.id: position for position, dgu in enumerate(self.dgus)}
