"""What acts on a DGU from outside its control: load currents, measurement noise, the initial state."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dgu_sim.linear import Component, FloatArray, Vector
from dgu_sim.loads import LoadModel
from dgu_sim.noise import NoiseModel
from dgu_sim.signals import BLOCK, RandomSource, Stream

__all__ = ["DguExogenous", "Exogenous", "GridExogenous", "SignalBlock"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalBlock:
    """The signals of steps start ... start+BLOCK-1.

    Attributes:
        start: First step, a multiple of BLOCK.
        load: I_L of each step [A].
        noise: Noise vector of each step, or None when there is none.
    """

    start: int
    load: Sequence[Component] | FloatArray
    noise: Sequence[Vector] | FloatArray | None


class Exogenous(Protocol):
    """Signals of one DGU in floats, or of all DGUs and runs in arrays."""

    def initial(self) -> Vector:
        """Return x at step 0."""
        ...

    def block(self, step: int) -> SignalBlock:
        """Return the block that holds a step."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class DguExogenous:
    """Signals of one DGU in one run.

    Attributes:
        seed: Seed of the run.
        dgu: Number of the DGU.
        loads: Its loads; their currents add up in this order.
        noise: Its measurement noise, or None.
        initial_state: V [V], I_t [A], v [V s] at step 0, before the spread.
        initial_spread: Half-widths of the uniform spread of the initial state.
        sampling_period_sec: T_s.
    """

    seed: int
    dgu: int
    loads: tuple[LoadModel, ...]
    noise: NoiseModel | None
    initial_state: tuple[float, float, float]
    initial_spread: tuple[float, float, float]
    sampling_period_sec: float

    def initial(self) -> Vector:
        """Return x at step 0, three floats."""
        drawn = self._source(Stream.INITIAL).generator(0).uniform(-1.0, 1.0, 3)
        spread = drawn * self.initial_spread
        return tuple(float(value) for value in np.array(self.initial_state) + spread)

    def arrays(self, start: int) -> tuple[FloatArray, FloatArray | None]:
        """Return load current (BLOCK,) [A] and noise (BLOCK, 3) or None of BLOCK steps from `start` on."""
        load = np.zeros(BLOCK)
        for item, one in enumerate(self.loads):
            source = self._source(Stream.LOAD + item)
            load = load + one.current(start, BLOCK, self.sampling_period_sec, source)
        noise = None if self.noise is None else self.noise.values(start, BLOCK, self._source(Stream.NOISE))
        return load, noise

    def block(self, step: int) -> SignalBlock:
        """Return the block that holds a step, as Python floats."""
        start = step - step % BLOCK
        load, noise = self.arrays(start)
        return SignalBlock(start=start, load=load.tolist(), noise=None if noise is None else noise.tolist())

    def _source(self, stream: int) -> RandomSource:
        return RandomSource(seed=self.seed, stream=stream, dgu=self.dgu)


@dataclass(frozen=True, slots=True, kw_only=True)
class GridExogenous:
    """Signals of all DGUs in several runs: exactly those of each `DguExogenous`, as arrays.

    Attributes:
        members: One row of DGUs, ascending, for each run.
    """

    members: tuple[tuple[DguExogenous, ...], ...]

    def initial(self) -> Vector:
        """Return x at step 0, shape (3, runs, DGUs)."""
        states = np.array([[one.initial() for one in run] for run in self.members])
        return np.ascontiguousarray(np.moveaxis(states, -1, 0))

    def block(self, step: int) -> SignalBlock:
        """Return the block that holds a step: load (BLOCK, runs, DGUs), noise (BLOCK, 3, runs, DGUs)."""
        start = step - step % BLOCK
        drawn = [[one.arrays(start) for one in run] for run in self.members]
        load = np.array([[load for load, _ in run] for run in drawn])
        noise = np.array([[noise for _, noise in run if noise is not None] for run in drawn])
        return SignalBlock(
            start=start,
            load=np.ascontiguousarray(load.transpose(2, 0, 1)),
            noise=np.ascontiguousarray(noise.transpose(2, 3, 0, 1)) if noise.size else None,
        )
