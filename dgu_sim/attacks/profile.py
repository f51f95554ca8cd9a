"""Biases that follow a profile in time: the base of ramp, sine and pulse."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.falsified import shifted
from dgu_sim.attacks.protocol import Attack
from dgu_sim.model import Vector3
from dgu_sim.records import Sample

__all__ = ["Profile"]


class _Elapsed(NamedTuple):
    """Samples since the start, and T_s."""

    samples: int
    sampling_period_sec: float


class Profile(Attack):
    """y^c_k = y_k + phi_k, T (19), the same phi_k on every link: a function of the samples since the attack's start."""

    @abstractmethod
    def phi(self, elapsed: int, sampling_period_sec: float) -> Vector3:
        """Return phi, `elapsed` samples after the first affected one."""

    def init(self, context: AttackContext) -> object:
        """Return the clock at the first affected sample."""
        return _Elapsed(0, context.sampling_period_sec)

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples with phi added."""
        assert isinstance(state, _Elapsed)  # noqa: S101 - what init returned
        phi = self.phi(*state)
        return _Elapsed(state.samples + 1, state.sampling_period_sec), shifted(samples, [phi] * len(samples))
