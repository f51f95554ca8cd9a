"""Every observer kind of the registry through its one entry, on histories of DGUs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor.detectors import build
from monitor.errors import MonitorError
from monitor.history import Experiment, History
from monitor.link_monitor import LinkMonitor
from monitor.observers import KINDS, design
from monitor.wording import describe

if TYPE_CHECKING:
    from numpy.typing import NDArray

A = np.array([[-0.28837, 0.10333, 5.39842], [-0.40767, -0.33421, 1.71161], [-0.00055, -0.00072, 0.95996]])
E = np.array([[-0.24792, 0.04004], [1.28837, 0.01188], [0.00179, 0.0098]])  # DGU 1, theory.md section 3
OPTIONS: dict[str, dict[str, object]] = {"delayed": {"delay": 2}, "cl_uie": {"future": 2}, "op_uie": {"future": 2}}


def states(steps: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(steps, 3) states of DGU 1 and the (steps, 2) inputs that made them."""
    generator = np.random.default_rng(seed)
    d = np.array([11.0, 50.0]) + generator.uniform(-1.0, 1.0, (steps, 2))
    rows = [generator.uniform(-1.0, 1.0, 3)]
    for one in d[:-1]:
        rows.append(A @ rows[-1] + E @ one)
    return np.array(rows), d


def history(sent: tuple[bool, bool, bool] = (True, True, True), *, applied: bool = True) -> History:
    """Sixty samples; outputs that are not sent are NaN."""
    x, d = states(60, 1)
    experiment = Experiment(np.empty((60, 0)), np.where(sent, x, np.nan), x, 0.01, d if applied else np.empty((60, 0)))
    return History((experiment,), 0.01)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_designs_runs_and_tells_of_itself(kind: str) -> None:
    """A link monitor of any kind is silent on the plant, alarms on a bias, and its certificate is JSON and words."""
    made = design(kind, history(), OPTIONS.get(kind, {}))
    assert made.accepted, made.verdict
    assert made.observer is not None
    document = json.loads(made.certificate.to_json())
    assert document["lag"] == made.certificate.lag
    assert describe(made.certificate)[0].startswith(f"{kind}: accepted")
    monitor = LinkMonitor(made.observer, build("fixed", {"settle_sec": 0.5, "calibrate_sec": 0.5}, 0.01), made.channels)
    state, alarms, estimates = monitor.init(), [], []
    x, _ = states(200, 2)
    for step, sample in enumerate(x):
        y = tuple(float(one) for one in sample + (0.1 if step >= 150 else 0.0))
        state, output = monitor.step(state, y, delivered=True)
        alarms.append(bool(output.alarm))
        estimates.append([float(one) for one in output.estimate])
    assert not any(alarms[:150])
    assert any(alarms[150:155])
    found, lag = np.array(estimates), made.certificate.lag
    if kind.endswith("uie"):
        assert np.isnan(found).all()  # it estimates inputs, no states
    else:
        np.testing.assert_allclose(found[100:150], x[100 - lag : 150 - lag], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("kind", ["delayed", "cl_uie", "reduced_order"])
def test_two_outputs_are_refused_as_blind(kind: str) -> None:
    """As many unknown inputs as outputs: whatever the method, its residual can show nothing, and that is said."""
    made = design(kind, history((True, True, False)), {"delayed": {"delay": 1}, "cl_uie": {"future": 2}}.get(kind, {}))
    assert not made.accepted
    assert "blind" in made.verdict


def test_a_blind_delayed_observer_is_taken_for_its_estimate_when_allowed() -> None:
    """allow_blind: the observer runs and is marked."""
    made = design("delayed", history((True, True, False)), {"delay": 1, "allow_blind": True})
    assert made.accepted
    assert made.blind


def test_one_output_has_a_guarantee_instead_of_exactness() -> None:
    """V only: the certificate holds the bounds, in words and JSON; input estimators are refused by condition (8)."""
    only_v = history((True, False, False))
    made = design("delayed", only_v, {"delay": 2})
    assert made.accepted
    guarantee = json.loads(made.certificate.to_json())["guarantee"]
    assert not guarantee["exact"]
    assert guarantee["gamma"] > 0.0
    assert 0.0 <= guarantee["decay"] < 1.0
    assert any(line.startswith("guaranteed for |w| <= 1") for line in describe(made.certificate))
    refused = design("cl_uie", only_v, {"future": 3})
    assert "condition (8)" in refused.verdict


def test_input_estimators_need_the_applied_inputs() -> None:
    """A history without d is refused with what to record."""
    assert "applied (d)" in design("cl_uie", history(applied=False), {"future": 2}).verdict


def test_an_unknown_option_is_misuse() -> None:
    """Options are checked by the kind."""
    with pytest.raises(MonitorError, match="delayed: option dely"):
        design("delayed", history(), {"dely": 1})


def test_noise_bound_holds_on_an_observer_around_an_operating_point() -> None:
    """Its constant input is no answer to noise: bounded noise never crosses the threshold, twice the noise does."""
    made = design("delayed", history(), {"delay": 1})
    assert made.observer is not None
    level = 1e-3
    generator = np.random.default_rng(4)
    x, _ = states(400, 5)
    crossed = []
    for scale in (1.0, 30.0):
        monitor = LinkMonitor(made.observer, build("noise_bound", {"noise": level, "settle_sec": 0.3}, 0.01))
        state, alarm = monitor.init(), False
        for sample in x:
            noisy = sample + scale * level * generator.uniform(-1.0, 1.0, 3)
            state, output = monitor.step(state, tuple(float(one) for one in noisy), delivered=True)
            alarm = alarm or bool(output.alarm)
        crossed.append(alarm)
    assert crossed == [False, True]
