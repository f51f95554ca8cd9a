"""Attacks that act on what the messages of a link say, by name: a new one is one new file and one line here.

Installed packages add theirs by entry points of the group `dcmg.attacks` (docs/plugins.md).
"""

import inspect
from collections.abc import Mapping

from dgu_sim.attacks.bias import Bias
from dgu_sim.attacks.bias_pulse import BiasPulse
from dgu_sim.attacks.bias_ramp import BiasRamp
from dgu_sim.attacks.bias_random import BiasRandom
from dgu_sim.attacks.bias_sine import BiasSine
from dgu_sim.attacks.bias_waveform import BiasWaveform
from dgu_sim.attacks.covert import Covert
from dgu_sim.attacks.delay import Delay
from dgu_sim.attacks.drop import Drop
from dgu_sim.attacks.freeze import Freeze
from dgu_sim.attacks.luenberger_stealthy import LuenbergerStealthy
from dgu_sim.attacks.protocol import Attack
from dgu_sim.attacks.replay import Replay
from dgu_sim.attacks.scaling import Scaling
from dgu_sim.attacks.uio_stealthy_plane import UioStealthyPlane
from dgu_sim.attacks.uio_stealthy_trajectory import UioStealthyTrajectory
from dgu_sim.attacks.zero_sum import ZeroSum
from dgu_sim.errors import PlugInError
from dgu_sim.plugins import Kinds

__all__ = ["FALSIFICATIONS", "GROUP", "SHIPPED", "checked_attack"]

GROUP = "dcmg.attacks"

SHIPPED: Mapping[str, type[Attack]] = {
    "bias": Bias,
    "bias_ramp": BiasRamp,
    "bias_sine": BiasSine,
    "bias_pulse": BiasPulse,
    "bias_random": BiasRandom,
    "bias_waveform": BiasWaveform,
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
}

_KEYS_OF_ALL = ("anyway", "kind", "link", "links", "start_sec", "stop_sec", "parameters")


def checked_attack(kind: str, found: object) -> type[Attack]:
    """Return what a plug-in brought, an attack class.

    Raises:
        PlugInError: It is none, or not a whole one.
    """
    if not (isinstance(found, type) and issubclass(found, Attack)):
        raise PlugInError(f"{kind} is {found!r}, expected a class that derives from dgu_sim.attacks.Attack")
    if inspect.isabstract(found):
        missing = ", ".join(sorted(found.__abstractmethods__))
        raise PlugInError(f"attack {kind} has no {missing}, expected init and step")
    taken = [name for name in found.model_fields if name in _KEYS_OF_ALL]
    if taken:
        raise PlugInError(f"attack {kind} has a parameter {taken[0]}, which is a key of every attack: rename it")
    return found


FALSIFICATIONS: Kinds[type[Attack]] = Kinds(GROUP, SHIPPED, checked_attack)
