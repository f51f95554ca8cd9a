"""No public design raises on finite arrays: what cannot be computed is refused in words."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor import input_estimators, local, observers
from monitor.backstop import guarded
from monitor.distributed import design as design_distributed
from monitor.distributed import linked, sampled
from monitor.distributed.gains import stability
from monitor.errors import HistoryError
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from collections.abc import Callable

SPOILT: dict[str, Callable[[Experiment], Experiment]] = {
    "huge": lambda one: _scaled(one, 1e300, 1e300),
    "large": lambda one: _scaled(one, 1e160, 1e160),
    "tiny": lambda one: _scaled(one, 1e-300, 1e-300),
    "denormal": lambda one: _scaled(one, 1e-318, 1e-318),
    "apart": lambda one: _scaled(one, 1e200, 1e-200),
    "outlier": lambda one: replace(one, x=_struck(one.x, 1e300)),
    "outlier of y": lambda one: replace(one, y=_struck(one.y, -1e307)),
    "zero": lambda one: _scaled(one, 0.0, 0.0),
    "constant": lambda one: replace(one, x=np.ones_like(one.x), y=np.ones_like(one.y)),
    "largest": lambda one: replace(one, x=np.full_like(one.x, np.finfo(float).max)),
}


def _scaled(one: Experiment, x: float, d: float) -> Experiment:
    return replace(one, x=one.x * x, y=one.y * x, d=one.d * d, w=one.w * x, u=one.u * d)


def _struck(table: np.ndarray, value: float) -> np.ndarray:
    struck = table.copy()
    struck[len(struck) // 2, 0] = value
    return struck


def _record(spoil: Callable[[Experiment], Experiment], *, inputs: int = 0) -> History:
    """Three states, two inputs of which `inputs` are known, two outputs."""
    generator = np.random.default_rng(3)
    A = np.array([[0.5, 0.3, 0.0], [-0.2, 0.6, 0.1], [0.4, 0.1, 0.8]])
    B = generator.standard_normal((3, 2))
    samples, x = generator.uniform(-1.0, 1.0, (60, 2)), [generator.uniform(-1.0, 1.0, 3)]
    for pushed in samples[:-1]:
        x.append(A @ x[-1] + B @ pushed)
    states = np.array(x)
    one = Experiment(samples[:, :inputs], states[:, :2], states, d=samples[:, inputs:], w=states[:, :2])
    return History((spoil(one),), 0.1)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numpy, about what the refusal says
@pytest.mark.parametrize("name", sorted(SPOILT))
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("full_order", {}),
        ("full_order", {"strategy": "dual_lqr", "noise_std": 1e-3, "allow_blind": True}),
        ("full_order", {"strategy": "pole_placement", "unknown_inputs": 1}),
        ("full_order", {"strategy": "max_sensitivity"}),
        ("reduced_order", {"strategy": "max_sensitivity", "unknown_inputs": 1}),
        ("reduced_order", {"strategy": "dual_lqr"}),
        ("delayed", {"delay": 2, "goal": "bounded", "unknown_inputs": 1}),
        ("delayed", {"delay": 1}),
        ("op_uie", {}),
        ("cl_uie", {}),
    ],
)
def test_observers_answer(name: str, kind: str, options: dict[str, object]) -> None:
    """A verdict in one line, whatever the numbers."""
    made = observers.design(kind, _record(SPOILT[name], inputs=1), options)
    assert made.verdict.startswith(("accepted: ", "refused: "))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", sorted(SPOILT))
def test_estimators_and_modules_answer(name: str) -> None:
    """The same for input estimators, a DGU's own module and the distributed design."""
    for kind in input_estimators.KINDS:
        assert input_estimators.design(kind, _record(SPOILT[name]), {}).verdict
    assert local.design(_record(SPOILT[name]), 1, {}).verdict
    record = _record(SPOILT[name], inputs=1)
    assert design_distributed([sampled(record)] * 2, linked(2, [(0, 1)]), {}).verdict


def test_the_step_is_named() -> None:
    """The refusal says where it happened."""
    with np.errstate(invalid="ignore"):
        verdict = guarded(lambda: str(stability(np.full((2, 2), np.nan), sampled=True)), str)
    assert verdict.startswith("the numbers leave double precision in the step distributed.gains.stability (")


def _fail(error: Exception) -> str:
    raise error


@pytest.mark.parametrize(
    "error", [HistoryError("short"), TypeError("shape"), ValueError("operands could not be broadcast")]
)
def test_misuse_and_refusals_go_on(error: Exception) -> None:
    """Nothing but a numerical failure is taken for one."""
    with pytest.raises(type(error)):
        guarded(lambda: _fail(error), str)


@pytest.mark.parametrize("error", [OverflowError("too large"), ValueError("array must not contain infs or NaNs")])
def test_numerical_failures_are_refused(error: Exception) -> None:
    """In the words of the library that found it."""
    assert str(error) in guarded(lambda: _fail(error), str)
