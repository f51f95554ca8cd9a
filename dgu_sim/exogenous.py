"""What acts on a DGU from outside its control: load currents, measurement noise, the initial state."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dgu_sim.compiled_signals import CompiledSignals, knows_loads, knows_noise
from dgu_sim.linear import Component, FloatArray, Vector
from dgu_sim.loads import LoadModel
from dgu_sim.noise import NoiseModel
from dgu_sim.signals import BLOCK, RandomSource, Stream

_LARGEST = 2**64  # kernels take seeds below it

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

    def load(self, start: int) -> FloatArray:
        """Return the load current of BLOCK steps from `start` on, shape (BLOCK,) [A]."""
        load = np.zeros(BLOCK)
        for item, one in enumerate(self.loads):
            source = self._source(Stream.LOAD + item)
            load = load + one.current(start, BLOCK, self.sampling_period_sec, source)
        return load

    def noise_from(self, start: int) -> FloatArray | None:
        """Return the noise of BLOCK steps from `start` on, shape (BLOCK, 3), or None."""
        return None if self.noise is None else self.noise.values(start, BLOCK, self._source(Stream.NOISE))

    def block(self, step: int) -> SignalBlock:
        """Return the block that holds a step, as Python floats."""
        start = step - step % BLOCK
        load, noise = self.load(start), self.noise_from(start)
        return SignalBlock(start=start, load=load.tolist(), noise=None if noise is None else noise.tolist())

    def _source(self, stream: int) -> RandomSource:
        return RandomSource(seed=self.seed, stream=stream, dgu=self.dgu)


@dataclass(frozen=True, slots=True, kw_only=True)
class GridExogenous:
    """Signals of all DGUs in several runs that differ in their seeds: exactly those of each `DguExogenous`, as arrays.

    Attributes:
        members: One row of DGUs, ascending, for each run.
    """

    members: tuple[tuple[DguExogenous, ...], ...]

    def initial(self) -> Vector:
        """Return x at step 0, shape (3, runs, DGUs)."""
        own, compiled = self.members[0], self._compiled()
        if compiled is not None and knows_loads([]):
            center, width = (
                np.array([getattr(one, name) for one in own]).T[:, np.newaxis]
                for name in ("initial_state", "initial_spread")
            )
            return np.asarray(center + compiled.spread() * width)
        states = np.array([[one.initial() for one in run] for run in self.members])
        return np.ascontiguousarray(np.moveaxis(states, -1, 0))

    def block(self, step: int) -> SignalBlock:
        """Return the block that holds a step: load (BLOCK, runs, DGUs), noise (BLOCK, 3, runs, DGUs)."""
        start = step - step % BLOCK
        own, compiled = self.members[0], self._compiled()
        loads, noise = [one.loads for one in own], own[0].noise
        if compiled is not None and knows_loads(loads):
            load = compiled.loads(start, loads)
        else:
            drawn_loads = np.array([[one.load(start) for one in run] for run in self.members])
            load = np.ascontiguousarray(drawn_loads.transpose(2, 0, 1))
        if noise is None:
            return SignalBlock(start=start, load=load, noise=None)
        if compiled is not None and knows_noise(noise):
            return SignalBlock(start=start, load=load, noise=compiled.noise(start, noise))
        drawn = np.array([[one.noise_from(start) for one in run] for run in self.members])
        return SignalBlock(start=start, load=load, noise=np.ascontiguousarray(drawn.transpose(2, 3, 0, 1)))

    def _compiled(self) -> CompiledSignals | None:
        own, seeds = self.members[0], [run[0].seed for run in self.members]
        if not all(0 <= seed < _LARGEST for seed in seeds):
            return None
        return CompiledSignals(
            seeds=np.array(seeds, dtype=np.uint64),
            dgus=np.array([one.dgu for one in own], dtype=np.uint64),
            sampling_period_sec=own[0].sampling_period_sec,
        )
