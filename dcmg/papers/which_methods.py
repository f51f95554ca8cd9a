"""The methods that `which_observer` compares: how each is designed, and what of it a detector watches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from monitor import input_estimators, observers
from monitor.delayed import Goal
from monitor.delayed.known_inputs import KnownInputOptions, design_known
from monitor.errors import HistoryError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from monitor.history import History
    from monitor.input_estimators import InputEstimator
    from monitor.linear import Component, Vector
    from monitor.observers import Observer


class Judgeable(Protocol):
    """What a detector sees of a method, one sample at a time."""

    def init(self, y: Sequence[Component]) -> Vector:
        """State before the first sample."""

    def step(self, state: Vector, y: Sequence[Component]) -> tuple[Vector, Sequence[Component]]:
        """Take a sample; what is watched."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Designed:
    """A method designed from a history, or the reason why not.

    Attributes:
        watched: None when refused.
        lag: steps by which what is watched, or the estimate, lags.
        blind: nothing that is falsified moves what is watched.
        verdict: of the design.
    """

    watched: Judgeable | None
    lag: int
    blind: bool
    verdict: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """One row of the study.

    Attributes:
        name: the method and the outputs it gets.
        outputs: how many of (V, I_t, v) it gets.
        record: what the history must hold besides y.
        gives: what a monitor gets from it.
        design: from a history.
    """

    name: str
    outputs: int
    record: str
    gives: str
    design: Callable[[History], Designed]


@dataclass(frozen=True, slots=True)
class _Residual:
    observer: Observer

    def init(self, y: Sequence[Component]) -> Vector:
        return self.observer.init((), y)

    def step(self, state: Vector, y: Sequence[Component]) -> tuple[Vector, Sequence[Component]]:
        following, found = self.observer.step(state, (), y)
        return following, list(found.residual)


@dataclass(frozen=True, slots=True)
class _Inputs:
    estimator: InputEstimator

    def init(self, y: Sequence[Component]) -> Vector:
        return self.estimator.init(y)

    def step(self, state: Vector, y: Sequence[Component]) -> tuple[Vector, Sequence[Component]]:
        following, found = self.estimator.step(state, y)
        return following, list(found)


@dataclass(frozen=True, slots=True)
class _Attack:
    """The last component of [d; phi]."""

    observer: Observer

    def init(self, y: Sequence[Component]) -> Vector:
        return self.observer.init((), y)

    def step(self, state: Vector, y: Sequence[Component]) -> tuple[Vector, Sequence[Component]]:
        following, found = self.observer.step(state, (), y)
        return following, [found.estimate[-1]]


def _residual(kind: str, **options: object) -> Callable[[History], Designed]:
    def make(history: History) -> Designed:
        made = observers.design(kind, history, options)
        watched = None if made.observer is None else _Residual(made.observer)
        return Designed(watched=watched, lag=made.certificate.lag, blind=made.blind, verdict=made.verdict)

    return make


def _inputs(kind: str, **options: object) -> Callable[[History], Designed]:
    def make(history: History) -> Designed:
        made = input_estimators.design(kind, history, options)
        watched = None if made.estimator is None else _Inputs(made.estimator)
        lag = 0 if made.estimator is None else made.estimator.lag
        return Designed(watched=watched, lag=lag, blind=False, verdict=made.verdict)

    return make


def _attack_on_v(history: History) -> Designed:
    try:
        found = design_known(history, KnownInputOptions(attacked=(0,), goal=Goal.EXACT))
    except HistoryError as error:
        return Designed(watched=None, lag=1, blind=False, verdict=str(error))
    watched = None if found.observer is None else _Attack(found.observer)
    return Designed(watched=watched, lag=1, blind=False, verdict=found.design.verdict)


_ESTIMATE = "state, residual"
_BLIND = "state only"
_INPUTS = "inputs, watched"
_KNOWN: Mapping[str, object] = {"unknown_inputs": 2}

METHODS = (
    Method(name="full_order, y = x", outputs=3, record="x", gives=_ESTIMATE, design=_residual("full_order", **_KNOWN)),
    Method(
        name="reduced_order, y = (V, I_t)",
        outputs=2,
        record="x",
        gives=_BLIND,
        design=_residual("reduced_order", allow_blind=True, **_KNOWN),
    ),
    Method(
        name="delayed 1, y = x",
        outputs=3,
        record="x",
        gives=_ESTIMATE,
        design=_residual("delayed", delay=1, **_KNOWN),
    ),
    Method(
        name="delayed 1, y = (V, I_t)",
        outputs=2,
        record="x",
        gives=_BLIND,
        design=_residual("delayed", delay=1, allow_blind=True, **_KNOWN),
    ),
    Method(
        name="delayed 2, y = V",
        outputs=1,
        record="x",
        gives="state within a bound, residual",
        design=_residual("delayed", delay=2, **_KNOWN),
    ),
    Method(name="op_uie, y = x", outputs=3, record="d", gives="residual", design=_residual("op_uie", future=2)),
    Method(name="cl_uie, y = x", outputs=3, record="d", gives="residual", design=_residual("cl_uie", future=2)),
    Method(name="inputs by one_step, y = x", outputs=3, record="x, d", gives=_INPUTS, design=_inputs("one_step")),
    Method(name="inputs by cl_uie, y = x", outputs=3, record="d", gives=_INPUTS, design=_inputs("cl_uie")),
    Method(name="inputs by delayed, y = (V, I_t)", outputs=2, record="x, d", gives=_INPUTS, design=_inputs("delayed")),
    Method(name="attack on V by delayed, y = x", outputs=3, record="x, d", gives="phi_V, watched", design=_attack_on_v),
)
