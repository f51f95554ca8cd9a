"""A scenario: everything that defines a run, checked and frozen."""

from collections.abc import Sequence
from pathlib import Path
from typing import Self

import yaml
from pydantic import Field, ValidationError, model_validator

from dgu_sim.errors import ScenarioError
from dgu_sim.explain import explain
from dgu_sim.grid import Grid, Line, Link, links_of
from dgu_sim.model import Frozen, Number
from dgu_sim.noise import Noise, NoNoise
from dgu_sim.plant import Coupling
from dgu_sim.poison import Poison
from dgu_sim.scenario_checks import check_parts, check_stability
from dgu_sim.scenario_file import apply_overrides, embed_tables, parse_yaml, raised_by, resolve_history_bag
from dgu_sim.settings import (
    AttackSettings,
    DguSettings,
    HistorySettings,
    LineSettings,
    MonitorSettings,
    ReceiverSettings,
    SecondarySettings,
)

__all__ = ["Scenario", "load_scenario", "parse_monitor", "parse_scenario"]


class Scenario(Frozen):
    """Grid, control, noise, attacks and monitors of one run."""

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
    monitor: MonitorSettings = Field(default_factory=MonitorSettings, description="Observer and detector.")
    attacks: tuple[AttackSettings, ...] = Field(default=(), description="Attacks that the scenario schedules.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_parts(self)
        check_stability(self, self.grid)
        return self

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

    def to_yaml(self) -> str:
        """Return the fully resolved scenario, defaults and tables included; `parse_scenario` reads it back."""
        return str(yaml.safe_dump(self.model_dump(mode="json"), sort_keys=False, allow_unicode=True, width=100))


def load_scenario(path: Path, overrides: Sequence[str] = ()) -> Scenario:
    """Read and check a scenario file.

    Args:
        path: The YAML file.
        overrides: "a.b=value" each; list indices count from 0, values are YAML.

    Raises:
        ScenarioError: One line with file, key, value and what was expected.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise ScenarioError(f"{path}: expected a readable scenario file: {reason}") from error
    return parse_scenario(text, source=str(path), overrides=overrides, directory=path.parent)


def parse_scenario(
    text: str, source: str = "scenario", overrides: Sequence[str] = (), directory: Path | None = None
) -> Scenario:
    """Check a scenario given as YAML text.

    Args:
        text: The YAML text.
        source: What to call it in messages.
        overrides: As for `load_scenario`.
        directory: Where CSV tables are looked for; None: the text must not name any.

    Raises:
        ScenarioError: One line with source, key, value and what was expected.
    """
    data = parse_yaml(text, source)
    apply_overrides(data, overrides, source)
    embed_tables(data, source, directory)
    resolve_history_bag(data, directory)
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        problem = explain(error, data)
        raise ScenarioError(f"{raised_by(problem.key, overrides, source)}: {problem}") from error


def parse_monitor(text: str, source: str, overrides: Sequence[str] = ()) -> MonitorSettings:
    """Check the monitor section of a scenario, given on its own as YAML text.

    Args:
        text: The YAML text.
        source: What to call it in messages.
        overrides: "monitor.a.b=value" each.

    Raises:
        ScenarioError: One line with source, key, value and what was expected.
    """
    data = {"monitor": parse_yaml(text, source)}
    apply_overrides(data, overrides, source)
    try:
        return MonitorSettings.model_validate(data["monitor"])
    except ValidationError as error:
        problem = explain(error, data["monitor"])
        raise ScenarioError(f"{raised_by(('monitor', *problem.key), overrides, source)}: monitor.{problem}") from error
