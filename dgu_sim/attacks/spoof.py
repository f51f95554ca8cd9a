"""A second publisher on the topic of a received output."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

from pydantic import AfterValidator, Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.falsifications import FALSIFICATIONS
from dgu_sim.attacks.protocol import Attack
from dgu_sim.errors import PlugInError
from dgu_sim.explain import part_of
from dgu_sim.grid import Link
from dgu_sim.model import finding
from dgu_sim.records import Sample

__all__ = ["Spoof"]


def _inner(falsify: Mapping[str, object]) -> Attack:
    kind = falsify.get("kind")
    try:
        attack = FALSIFICATIONS[str(kind)]
    except PlugInError as error:
        raise finding(("kind",), kind, str(error)) from error
    except KeyError:
        attack = None
    if attack is None or attack.publishes:
        expected = f"expected what the messages say, one of {', '.join(FALSIFICATIONS)}"
        raise finding(("kind",), kind, expected)
    return part_of(attack, {key: value for key, value in falsify.items() if key != "kind"})


def _checked(falsify: dict[str, object]) -> dict[str, object]:
    return {"kind": falsify.get("kind"), **_inner(falsify).model_dump(mode="json")}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Imposter:
    """What makes up the messages, and its state."""

    attack: Attack
    state: object


class Spoof(Attack):
    """Another publisher sends a falsified message of each step behind the true one, which stays as it is.

    Every other attack replaces what a link carries; here the receiver gets two messages of the same step that claim
    the same source. What it makes of them is `receiver.accept`.
    """

    knows: ClassVar[str] = "what its falsification knows"
    publishes: ClassVar[bool] = True

    falsify: Annotated[dict[str, object], AfterValidator(_checked)] = Field(
        description="What the messages say: the `kind` of another attack with its parameters, applied to the true ones."
    )

    def check_links(self, links: Sequence[Link]) -> None:
        """Check that the falsification can act on these links together."""
        _inner(self.falsify).check_links(links)

    def init(self, context: AttackContext) -> object:
        """Return the falsification before its first sample."""
        attack = _inner(self.falsify)
        return _Imposter(attack=attack, state=attack.init(context))

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return what the second publisher sends."""
        assert isinstance(state, _Imposter)  # noqa: S101 - what init returned
        following, falsified = state.attack.step(state.state, samples)
        return replace(state, state=following), falsified
