"""Attacks that act on what the messages of a link say, by name: a new one is one new file and one line here."""

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

__all__ = ["FALSIFICATIONS"]

FALSIFICATIONS: Mapping[str, type[Attack]] = {
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
