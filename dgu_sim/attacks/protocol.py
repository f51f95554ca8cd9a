"""What an attack is: something that changes messages on the wire, and nothing else."""

from abc import abstractmethod
from collections.abc import Sequence

from dgu_sim.model import Frozen
from dgu_sim.records import Sample

__all__ = ["Attack"]


class Attack(Frozen):
    """Acts on the samples of its links, step by step.

    An attack is frozen and holds parameters only (its fields: the keys of a scenario and of the ROS service);
    what it remembers between steps, a recording or a phase, is its state. One that works on several links sees
    all their samples of a step at once.
    """

    @abstractmethod
    def init(self) -> object:
        """Return the state before the first affected sample."""

    @abstractmethod
    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the next state and the samples to deliver, one for each link, in the order received."""
