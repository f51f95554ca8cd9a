"""The history of a DGU on its way to the monitors."""

from collections.abc import Sequence

from dgu_sim.linear import FloatArray
from dgu_sim.scenario import Scenario
from dgu_sim.signals import RandomSource, Stream
from dgu_sim.unit import equilibrium

__all__ = ["poisoned"]


def poisoned(scenario: Scenario, dgu: int, states: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Return the states of each experiment (T, 3) as the attackers of a scenario let them through.

    Args:
        scenario: Its `poison` section says what they do, one after the other.
        dgu: Number of the DGU.
        states: The true record.

    Raises:
        ScenarioError: The record does not allow it.
    """
    falsified = tuple(states)
    for number, poison in enumerate(scenario.poison):
        if poison.dgu == dgu:
            source = RandomSource(seed=scenario.seed, stream=Stream.POISON, dgu=dgu)
            falsified = poison.falsify(falsified, equilibrium(scenario, dgu), source.generator(number))
    return falsified
