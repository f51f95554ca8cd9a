"""What attackers know of the grid of a scenario."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dgu_sim.errors import AttackError
from dgu_sim.experiment import run_experiments
from dgu_sim.grid import Link
from dgu_sim.linear import FloatArray
from dgu_sim.matrices import continuous, discretise
from dgu_sim.plant import Coupling
from dgu_sim.settings import OutputComponent

if TYPE_CHECKING:
    from dgu_sim.scenario import Scenario

__all__ = ["ScenarioKnowledge"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioKnowledge:
    """Everything an attack may ask for, from the scenario: `dgu_sim.attacks.context.Knowledge`.

    Attributes:
        scenario: The scenario.
        recorded: Recorded states (T, 3) of each experiment by DGU, where `history.bag` holds them; None: none read.
    """

    scenario: "Scenario"
    recorded: Mapping[int, Sequence[FloatArray]] | None = None

    def model(self, dgu: int) -> tuple[FloatArray, FloatArray]:
        """Return A (3, 3) and E (3, 2) of one DGU with its lines, as its history shows it."""
        grid = self.scenario.grid
        isolated = self.scenario.coupling is Coupling.ISOLATED
        conductance = 0.0 if isolated else sum(grid.conductances(dgu).values())
        A_c, E_c = continuous(grid.parameters[dgu], conductance)
        return discretise(A_c, E_c, self.scenario.sampling_period_sec)

    def history(self, dgu: int, seed: int) -> Sequence[FloatArray]:
        """Return the states (T, 3) of each experiment: the very record the monitors learn from, not poisoned.

        Raises:
            AttackError: The record is in a bag that was not handed over.
        """
        if self.recorded is not None and dgu in self.recorded:
            return self.recorded[dgu]
        if self.scenario.history.bag is not None:
            bag = self.scenario.history.bag
            raise AttackError(f"the history of DGU {dgu} is in {bag}: expected it to be read first")
        run = self.scenario.model_copy(update={"seed": seed})
        return tuple(np.asarray(experiment.x) for experiment in run_experiments(run, dgu))

    def keeps(self, dgu: int) -> tuple[str, ...]:
        """Return the components of its output that one DGU does not send."""
        return tuple(one.value for one in OutputComponent if one not in self.scenario.dgu(dgu).output)

    def conductance(self, link: Link) -> float:
        """Return 1/R_ij [S] of the power line along a link."""
        return self.scenario.grid.conductances(link.target)[link.source]

    def rated_current(self, dgu: int) -> float:
        """Return I^r [A] of one DGU."""
        return self.scenario.dgu(dgu).rated_current_a
