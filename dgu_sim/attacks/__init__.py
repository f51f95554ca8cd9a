"""Attacks on communication links: frozen objects that map messages to messages."""

from dgu_sim.attacks.bias import Bias
from dgu_sim.attacks.context import AttackContext, Knowledge
from dgu_sim.attacks.protocol import Attack
from dgu_sim.attacks.registry import KINDS, build_attack, expected_class, known_kind, usable_kinds

__all__ = [
    "KINDS",
    "Attack",
    "AttackContext",
    "Bias",
    "Knowledge",
    "build_attack",
    "expected_class",
    "known_kind",
    "usable_kinds",
]
