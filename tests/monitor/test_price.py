"""What held-back samples and spare columns cost: the shortest history of a DGU that each kind accepts.

`python -m pytest tests/monitor/test_price.py -s` prints the table of docs/which_observer.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from monitor import input_estimators, observers
from monitor.history import Experiment, History
from tests.monitor.conftest import dgu_plant

if TYPE_CHECKING:
    from numpy.typing import NDArray

# kind, outputs sent, options on exact data and with noise 1e-3, shortest exact and noisy history of DGU 1 (samples)
ROWS: dict[str, tuple[Any, str, int, dict[str, Any], dict[str, Any], int, int]] = {
    "delayed 1, y = x": (observers, "delayed", 3, {"delay": 1}, {"unknown_inputs": 2}, 10, 12),
    "delayed 2, y = V": (observers, "delayed", 1, {"delay": 2}, {"unknown_inputs": 2}, 10, 12),
    "op_uie, y = x": (observers, "op_uie", 3, {}, {"order": 3}, 28, 43),
    "cl_uie, y = x": (observers, "cl_uie", 3, {}, {"order": 3}, 28, 43),
    "inputs by one_step, y = x": (
        input_estimators,
        "one_step",
        3,
        {},
        {"observer_options": {"unknown_inputs": 2}},
        10,
        12,
    ),
    "inputs by delayed, y = (V, I_t)": (input_estimators, "delayed", 2, {}, {}, 9, 10),
}


@pytest.mark.parametrize("name", ROWS)
def test_the_shortest_histories_are_those_of_the_docs(name: str) -> None:
    """Exact and with noise 1e-3: no sample less is accepted, and what is accepted says on how many it was proved."""
    module, kind, outputs, exact, more, shortest, noisy = ROWS[name]
    found = []
    for noise, options in ((0.0, exact), (1e-3, {**exact, **more})):
        x, d = _run(noise)
        samples = next(T for T in range(5, 60) if module.design(kind, _history(x, d, T, outputs), options).accepted)
        assert "unseen samples" in module.design(kind, _history(x, d, samples, outputs), options).verdict
        found.append(samples)
    print(f"| {name} | {found[0]} | {found[1]} |")  # noqa: T201 - the table of the docs
    assert found[0] == shortest
    assert found[1] <= 2 * noisy  # noise is drawn: the last sample that it takes is not the plant's


def _run(noise: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    generator = np.random.default_rng(0)
    start = generator.uniform(-1.0, 1.0, 3)
    d = np.array([11.0, 50.0]) + generator.uniform(-1.0, 1.0, (400, 2))
    _, x = dgu_plant(1).run(start, np.zeros((400, 0)), d)
    return x + noise * generator.standard_normal(x.shape), d


def _history(x: NDArray[np.float64], d: NDArray[np.float64], samples: int, outputs: int) -> History:
    one = Experiment(np.empty((samples, 0)), x[:samples, :outputs], x[:samples], 0.01, d[:samples])
    return History((one,), 0.01, comparable=True)
