"""Falsified histories: what an attacker makes of the record from which a monitor learns a DGU."""

from collections.abc import Sequence
from math import cos, sin
from typing import Annotated, Literal, Protocol, TypeAlias

import numpy as np
from pydantic import Field

from dgu_sim.attacks.parity import parity_of_history
from dgu_sim.errors import ScenarioError
from dgu_sim.linear import FloatArray
from dgu_sim.model import Frozen, Number, Vector3

__all__ = ["HidePoison", "InjectPoison", "NoisePoison", "Poison", "PoisonModel", "RotatePoison", "ScalePoison"]

Victim: TypeAlias = Annotated[int, Field(ge=1, description="Number of the DGU whose history is falsified.")]


class PoisonModel(Protocol):
    """What every falsification can do."""

    def falsify(
        self, states: Sequence[FloatArray], rest: Vector3, generator: np.random.Generator
    ) -> tuple[FloatArray, ...]:
        """Return the states of each experiment (T, 3) as the monitors get them.

        Args:
            states: The true record.
            rest: The victim's state at rest, V [V], I_t [A], v [V s].
            generator: Random numbers.

        Raises:
            ScenarioError: The record does not allow it.
        """
        ...


class ScalePoison(Frozen):
    """x' = diag(gain) x: rows scaled. The relation between the rows is another one, their rank is the same."""

    kind: Literal["scale"] = Field(description="Rows are scaled.")
    dgu: Victim
    gain: Vector3 = Field(description="Factors of V, I_t and v, none of them 0.")

    def falsify(
        self, states: Sequence[FloatArray], rest: Vector3, generator: np.random.Generator
    ) -> tuple[FloatArray, ...]:
        """Return the scaled record."""
        del rest, generator
        return tuple(one * np.array(self.gain) for one in states)


class RotatePoison(Frozen):
    """x' = R x: V and I_t turned into each other."""

    kind: Literal["rotate"] = Field(description="V and I_t are mixed.")
    dgu: Victim
    angle_rad: Number = Field(description="Angle of the rotation [rad].")

    def falsify(
        self, states: Sequence[FloatArray], rest: Vector3, generator: np.random.Generator
    ) -> tuple[FloatArray, ...]:
        """Return the turned record."""
        del rest, generator
        c, s = cos(self.angle_rad), sin(self.angle_rad)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return tuple(one @ turn.T for one in states)


class NoisePoison(Frozen):
    """x' = x + rho, rho_k ~ N(0, std_k^2): however small, it raises the rank of exact data (theory section 3)."""

    kind: Literal["noise"] = Field(description="Small noise on every number.")
    dgu: Victim
    std: Vector3 = Field(description="Standard deviations on V [V], I_t [A], v [V s].")

    def falsify(
        self, states: Sequence[FloatArray], rest: Vector3, generator: np.random.Generator
    ) -> tuple[FloatArray, ...]:
        """Return the record with noise on it."""
        del rest
        return tuple(one + generator.standard_normal(one.shape) * np.array(self.std) for one in states)


class InjectPoison(Frozen):
    """One experiment more: the first one with s_k direction added, s_k ~ U(-amplitude, amplitude).

    What looks like a third unknown input leaves exact data without any relation. Where the number of unknown inputs is
    given, the strongest directions count as such: the injected one, and the weaker of the true two is dropped.
    """

    kind: Literal["inject"] = Field(description="A made-up experiment is added.")
    dgu: Victim
    direction: Vector3 = Field(description="What is added again and again: V [V], I_t [A], v [V s].")
    amplitude: Number = Field(default=10.0, gt=0, description="How often it is added, at most.")

    def falsify(
        self, states: Sequence[FloatArray], rest: Vector3, generator: np.random.Generator
    ) -> tuple[FloatArray, ...]:
        """Return the record with the made-up experiment at its end."""
        del rest
        drawn = self.amplitude * generator.uniform(-1.0, 1.0, len(states[0]))
        return (*states, states[0] + drawn[:, np.newaxis] * np.array(self.direction))


class HidePoison(Frozen):
    """x' = M x such that a bias of the attacker's choice leaves no residual at any step, and the state at rest stays.

    The true record obeys past . x_k + future . x_k+1 = 0; x' obeys the same with x = M^-1 x'. An observer that learned
    x' cannot see s_k bias for any s if M^-1 bias is orthogonal to past and to future. With n the direction orthogonal
    to both, c = n . bias / n . n and l . bias = 1, l . rest = 0: M^-1 = 1 + (c n - bias) l', which keeps `rest`.
    """

    kind: Literal["hide"] = Field(description="Rows are mixed such that a later bias is not seen.")
    dgu: Victim
    bias: Vector3 = Field(description="The bias to hide: V [V], I_t [A], v [V s].")

    @property
    def _name(self) -> str:
        return f"poison of DGU {self.dgu}: bias {list(self.bias)}"

    def falsify(
        self, states: Sequence[FloatArray], rest: Vector3, generator: np.random.Generator
    ) -> tuple[FloatArray, ...]:
        """Return the mixed record."""
        del generator
        bias = np.array(self.bias)
        relation = parity_of_history(states, self.dgu)
        n = np.cross(relation[:3], relation[3:])
        hidden = (n @ bias) / (n @ n) * n
        conditions = np.stack([bias, np.array(rest)])
        if np.linalg.matrix_rank(conditions) < len(conditions):
            raise ScenarioError(f"{self._name}: expected a bias that is no multiple of the state at rest")
        reader = np.linalg.lstsq(conditions, np.array([1.0, 0.0]), rcond=None)[0]
        inverse = np.eye(3) + np.outer(hidden - bias, reader)
        if abs(np.linalg.det(inverse)) < _SMALLEST:
            raise ScenarioError(f"{self._name}: expected a bias that can be hidden")
        M = np.linalg.inv(inverse)
        return tuple(one @ M.T for one in states)


_SMALLEST = 1e-9  # determinant below which the record would lose a direction
Poison: TypeAlias = Annotated[
    ScalePoison | RotatePoison | NoisePoison | InjectPoison | HidePoison, Field(discriminator="kind")
]
