"""What an attack is: something that changes messages on the wire, and nothing else."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from dgu_sim.attacks.context import AttackContext
from dgu_sim.grid import Link
from dgu_sim.model import Frozen
from dgu_sim.records import Sample

__all__ = ["Attack"]


class Attack(Frozen):
    """Acts on the samples of its links, step by step.

    An attack is frozen and holds parameters only (its fields: the keys of a scenario and of the ROS service);
    what it remembers between steps, a recording or a phase, is its state. One that works on several links sees
    all their samples of a step at once. Its samples hold floats, or arrays over runs: it computes with components.

    Attributes:
        knows: What the attacker must know beyond the messages on its links.
        whole_output: Whether the source of each link must send V, I_t and v.
        publishes: Whether its samples are messages of a second publisher, beside those that the link carries.
    """

    knows: ClassVar[str] = "nothing"
    whole_output: ClassVar[bool] = False
    publishes: ClassVar[bool] = False

    def check_links(self, links: Sequence[Link]) -> None:
        """Check that the attack can act on these links together.

        Raises:
            AttackError: It cannot: one line with what was expected.
        """

    @abstractmethod
    def init(self, context: AttackContext) -> object:
        """Return the state before the first affected sample.

        Raises:
            AttackError: The parameters do not fit the links, or nothing is known of what the attack builds on.
        """

    @abstractmethod
    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the next state and the samples to deliver, one for each link, in the order received."""
