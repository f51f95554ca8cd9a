"""Attack classes by name: a new attack is one new file and one line here."""

from collections.abc import Mapping

from pydantic import ValidationError

from dgu_sim.attacks.bias import Bias
from dgu_sim.attacks.bias_pulse import BiasPulse
from dgu_sim.attacks.bias_ramp import BiasRamp
from dgu_sim.attacks.bias_random import BiasRandom
from dgu_sim.attacks.bias_sine import BiasSine
from dgu_sim.attacks.covert import Covert
from dgu_sim.attacks.delay import Delay
from dgu_sim.attacks.drop import Drop
from dgu_sim.attacks.freeze import Freeze
from dgu_sim.attacks.luenberger_stealthy import LuenbergerStealthy
from dgu_sim.attacks.protocol import Attack
from dgu_sim.attacks.replay import Replay
from dgu_sim.attacks.scaling import Scaling
from dgu_sim.attacks.spoof import Spoof
from dgu_sim.attacks.uio_stealthy_plane import UioStealthyPlane
from dgu_sim.attacks.uio_stealthy_trajectory import UioStealthyTrajectory
from dgu_sim.attacks.zero_sum import ZeroSum
from dgu_sim.errors import AttackError
from dgu_sim.explain import explain

__all__ = ["KINDS", "build_attack", "known_kind"]

KINDS: Mapping[str, type[Attack]] = {
    "bias": Bias,
    "bias_ramp": BiasRamp,
    "bias_sine": BiasSine,
    "bias_pulse": BiasPulse,
    "bias_random": BiasRandom,
    "scaling": Scaling,
    "freeze": Freeze,
    "delay": Delay,
    "drop": Drop,
    "replay": Replay,
    "zero_sum": ZeroSum,
    "uio_stealthy_plane": UioStealthyPlane,
    "uio_stealthy_trajectory": UioStealthyTrajectory,
    "luenberger_stealthy": LuenbergerStealthy,
    "covert": Covert,
    "spoof": Spoof,
}


def known_kind(kind: str) -> type[Attack]:
    """Return the attack class of a name.

    Raises:
        AttackError: There is none; the message lists the known ones.
    """
    if kind not in KINDS:
        raise AttackError(f"kind = {kind!r}: expected an attack class, one of {', '.join(KINDS)}")
    return KINDS[kind]


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
