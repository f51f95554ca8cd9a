"""The sections of a scenario, and what follows from them."""

from pydantic import Field

from dgu_sim.errors import ScenarioError
from dgu_sim.grid import Grid, Line, Link, links_of
from dgu_sim.model import Frozen, Number
from dgu_sim.noise import Noise, NoNoise
from dgu_sim.plant import Coupling
from dgu_sim.poison import Poison
from dgu_sim.settings import (
    AttackSettings,
    DguSettings,
    HistorySettings,
    LineSettings,
    ReceiverSettings,
    SecondarySettings,
)

__all__ = ["Sections"]


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

    @property
    def steps(self) -> int:
        """Number of steps: messages k = 0 ... steps-1."""
        return max(1, round(self.duration_sec / self.sampling_period_sec))

    @property
    def sampling_period_ns(self) -> int:
        """T_s in whole nanoseconds: the stamp of step k is k times this."""
        return round(self.sampling_period_sec * 1e9)

    @property
    def grid(self) -> Grid:
        """Topology and parameters."""
        return Grid(
            dgus=tuple(dgu.id for dgu in self.dgus),
            parameters={dgu.id: dgu.parameters for dgu in self.dgus},
            lines=tuple(Line(between=line.between, resistance_ohm=line.resistance_ohm) for line in self.lines),
        )

    @property
    def links(self) -> tuple[Link, ...]:
        """Directed communication links, by target, then source: the order of every array axis "links"."""
        return links_of([line.between for line in self.lines])

    def dgu(self, number: int) -> DguSettings:
        """Return the settings of one DGU.

        Raises:
            ScenarioError: There is no such DGU.
        """
        for dgu in self.dgus:
            if dgu.id == number:
                return dgu
        raise ScenarioError(f"DGU {number}: expected one of {', '.join(str(dgu.id) for dgu in self.dgus)}")
