"""Loads and noise of all DGUs of many runs, drawn in compiled kernels: the bits of numpy's generators."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dgu_sim.linear import FloatArray
from dgu_sim.loads import ConstantLoad, GaussianLoad, LoadModel, RampLoad, StepLoad, TableLoad, UniformLoad, hold_steps
from dgu_sim.noise import GaussianNoise, NoiseModel, UniformNoise
from dgu_sim.signals import BLOCK, RandomSource, Stream
from engine import NUMPY, chosen
from engine.kernels import draw

__all__ = ["CompiledSignals", "knows_loads", "knows_noise"]

_LOADS, _NOISE, _SPREAD = 0, 1, 2  # what is drawn, as in engine/native/module.c
_FIXED, _UNIFORM, _NORMAL = 0, 1, 2  # kinds, as in engine/native/signals.h
_SAME_IN_ALL_RUNS = (ConstantLoad, StepLoad, RampLoad, TableLoad)


def knows_loads(loads: Sequence[Sequence[LoadModel]]) -> bool:
    """Whether the kernels draw these loads of each DGU.

    Raises:
        EngineError: The environment asks for kernels that are not there.
    """
    known = (*_SAME_IN_ALL_RUNS, UniformLoad, GaussianLoad)
    return _trusted() and all(type(one) in known for own in loads for one in own)


def knows_noise(noise: NoiseModel | None) -> bool:
    """Whether the kernels draw this noise.

    Raises:
        EngineError: The environment asks for kernels that are not there.
    """
    return _trusted() and isinstance(noise, UniformNoise | GaussianNoise)


@dataclass(frozen=True, slots=True, kw_only=True)
class CompiledSignals:
    """What `DguExogenous` draws, for all DGUs and runs at once.

    Attributes:
        seeds: Seed of each run.
        dgus: Numbers of the DGUs.
        sampling_period_sec: T_s.
    """

    seeds: NDArray[np.uint64]
    dgus: NDArray[np.uint64]
    sampling_period_sec: float

    def loads(self, start: int, loads: Sequence[Sequence[LoadModel]]) -> FloatArray:
        """Return the currents [A] of BLOCK steps, shape (BLOCK, runs, DGUs), from the loads of each DGU."""
        first = np.cumsum([0, *(len(own) for own in loads)])
        items = [item for own in loads for item in enumerate(own)]
        described = [self._described(number, one) for number, one in items]
        fixed = np.zeros((len(items), BLOCK))
        nobody = RandomSource(seed=0, stream=0, dgu=0)
        for row, (_, one) in zip(fixed, items, strict=True):
            if isinstance(one, _SAME_IN_ALL_RUNS):
                row[:] = one.current(start, BLOCK, self.sampling_period_sec, nobody)
        return self._drawn(
            (_LOADS, len(items), start, 0, 0),
            (
                first.astype(np.int64),
                np.array([one[:3] for one in described], dtype=np.int64),
                np.array([one[3:] for one in described], dtype=np.float64),
                fixed,
                None,
            ),
            (BLOCK,),
        )

    def noise(self, start: int, noise: NoiseModel) -> FloatArray:
        """Return the noise of BLOCK steps, shape (BLOCK, 3, runs, DGUs)."""
        assert isinstance(noise, UniformNoise | GaussianNoise)  # noqa: S101 - `knows_noise` has seen to it
        uniform = isinstance(noise, UniformNoise)
        scale = np.array(noise.half_width if isinstance(noise, UniformNoise) else noise.std, dtype=np.float64)
        what = (_NOISE, 0, start, _UNIFORM if uniform else _NORMAL, int(Stream.NOISE))
        return self._drawn(what, (None, None, None, None, scale), (BLOCK, 3))

    def spread(self) -> FloatArray:
        """Return what spreads the initial states, in -1 ... 1, shape (3, runs, DGUs)."""
        out = np.empty((len(self.seeds), len(self.dgus), 3))
        draw(self._sizes(_SPREAD, 0, 0, _UNIFORM, int(Stream.INITIAL)), (self.seeds, self.dgus, *(None,) * 5, out))
        return np.ascontiguousarray(np.moveaxis(out, -1, 0))

    def _drawn(
        self, what: tuple[int, int, int, int, int], given: tuple[object, ...], shape: tuple[int, ...]
    ) -> FloatArray:
        out = np.empty((*shape, len(self.seeds), len(self.dgus)))
        draw(self._sizes(*what), (self.seeds, self.dgus, *given, out))
        return out

    def _sizes(self, what: int, items: int, start: int, kind: int, stream: int) -> tuple[int, ...]:
        return what, len(self.seeds), len(self.dgus), items, start, kind, stream

    def _described(self, number: int, load: LoadModel) -> tuple[int, int, int, float, float]:
        """Kind, stream, steps that a value is held, and two numbers of one load."""
        if isinstance(load, UniformLoad):
            hold = hold_steps(load.hold_sec, self.sampling_period_sec)
            return _UNIFORM, Stream.LOAD + number, hold, load.low_a, load.high_a - load.low_a
        if isinstance(load, GaussianLoad):
            return (
                _NORMAL,
                Stream.LOAD + number,
                hold_steps(load.hold_sec, self.sampling_period_sec),
                load.mean_a,
                load.std_a,
            )
        return _FIXED, 0, 1, 0.0, 0.0


def _trusted() -> bool:
    return chosen() != NUMPY and _as_numpy_draws()


@cache
def _as_numpy_draws() -> bool:
    """Whether the kernels draw what this numpy draws: another version of it may draw other numbers from a seed."""
    seeds, dgus = np.array([0, 2**40 + 5], dtype=np.uint64), np.array([1, 7], dtype=np.uint64)
    signals = CompiledSignals(seeds=seeds, dgus=dgus, sampling_period_sec=1.0)
    noise = GaussianNoise(kind="gaussian", std=(1.0, 1.0, 1.0))
    found = signals.noise(BLOCK, noise)
    return all(
        np.array_equal(
            found[:, :, run, place],
            noise.values(BLOCK, BLOCK, RandomSource(seed=int(seed), stream=Stream.NOISE, dgu=int(dgu))),
        )
        for run, seed in enumerate(seeds)
        for place, dgu in enumerate(dgus)
    )
