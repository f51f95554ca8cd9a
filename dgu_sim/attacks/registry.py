"""All attack classes by name: what falsifies messages, and who publishes falsified ones beside the true ones."""

from collections.abc import Mapping

from pydantic import ValidationError

from dgu_sim.attacks.falsifications import GROUP, SHIPPED, checked_attack
from dgu_sim.attacks.protocol import Attack
from dgu_sim.attacks.spoof import Spoof
from dgu_sim.errors import AttackError, PlugInError
from dgu_sim.explain import explain
from dgu_sim.plugins import Kinds
from dgu_sim.suggestions import meant

__all__ = ["KINDS", "build_attack", "expected_class", "known_kind", "usable_kinds"]

KINDS: Kinds[type[Attack]] = Kinds(GROUP, {**SHIPPED, "spoof": Spoof}, checked_attack)


def expected_class(kind: str) -> str:
    """Return what is expected instead of a name that no attack class has."""
    return f"expected an attack class, one of {', '.join(KINDS)}; {meant(kind, KINDS)}".removesuffix("; ")


def known_kind(kind: str) -> type[Attack]:
    """Return the attack class of a name.

    Raises:
        AttackError: There is none, and the message lists the known ones; or it is of a plug-in that cannot be used.
    """
    if kind not in KINDS:
        raise AttackError(f"kind = {kind!r}: {expected_class(kind)}")
    try:
        return KINDS[kind]
    except PlugInError as error:
        raise AttackError(str(error)) from error


def usable_kinds() -> tuple[dict[str, type[Attack]], list[str]]:
    """Return every attack class by name, and a line for each plug-in that cannot be used."""
    found: dict[str, type[Attack]] = {}
    problems = []
    for kind in KINDS:
        try:
            found[kind] = known_kind(kind)
        except AttackError as error:
            problems.append(str(error))
    return found, problems


def build_attack(kind: str, parameters: Mapping[str, object]) -> Attack:
    """Return the attack of one class with its parameters checked.

    Raises:
        AttackError: The kind is unknown, or a parameter is missing, unknown or wrong.
    """
    attack = known_kind(kind)
    try:
        return attack.model_validate(parameters)
    except ValidationError as error:
        problem = explain(error, parameters)
        raise AttackError(f"{kind} attack: {problem}") from error
