"""The module of the own state: what neighbours' voltages leave unexplained."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor import local
from monitor.detectors import Phase, build
from monitor.errors import MonitorError
from monitor.history import Experiment, History
from monitor.local import LocalModule, LocalState

A = np.array([[-0.29, 0.10, 5.40], [-0.41, -0.33, 1.71], [-0.0006, -0.0007, 0.96]])
TOWARD_LOAD, TOWARD_REFERENCE = np.array([-0.25, 1.29, 0.0018]), np.array([0.04, 0.012, 0.0098])
LINES = np.array([20.0, 14.0, 10.0])  # 1/R_ij [S]
LOAD, REFERENCE = 10.0, 48.0


def _next(x: NDArray[np.float64], voltages: NDArray[np.float64], reference: float, load: float) -> NDArray[np.float64]:
    """x+ = A x + b (I_L - sum_j V_j / R_ij) + e (V_ref + alpha)."""
    return A @ x + TOWARD_LOAD * (load - LINES @ voltages) + TOWARD_REFERENCE * reference


def _history(seed: int = 0, samples: int = 30, noise: float = 0.0) -> History:
    rng = np.random.default_rng(seed)
    load = LOAD + rng.uniform(-1.0, 1.0, samples)
    reference = REFERENCE + rng.uniform(-1.0, 1.0, samples)
    voltages = REFERENCE + rng.uniform(-1.0, 1.0, (samples, len(LINES)))
    x = [rng.uniform(-1.0, 1.0, 3)]
    for k in range(samples - 1):
        x.append(_next(x[-1], voltages[k], reference[k], load[k]))
    states = np.array(x) + noise * rng.standard_normal((samples, 3))
    applied, own = np.column_stack([load - voltages @ LINES, reference]), np.column_stack([load, voltages])
    return History((Experiment(np.empty((samples, 0)), states, states, 0.01, applied, own),), 0.01)


def _module(history: History | None = None, learn_steps: int = 10, load_range: float = 0.0) -> LocalModule:
    detector = build("fixed", {"settle_sec": 0.2, "calibrate_sec": 0.3}, 0.01)
    design = local.design(history or _history(), len(LINES), {})
    assert design.accepted, design.verdict
    return LocalModule(design=design, detector=detector, learn_steps=learn_steps, load_range=load_range)


def _run(
    module: LocalModule, load: NDArray[np.float64], phi: NDArray[np.float64], missing: frozenset[int] = frozenset()
) -> tuple[LocalState, list[local.LocalOutput]]:
    """Feed a run in which the neighbours' voltages are told with phi (T, neighbours) added."""
    rng = np.random.default_rng(9)
    state, x, outputs = module.init(), rng.uniform(-1.0, 1.0, 3), []
    for k in range(len(load)):
        voltages, reference = REFERENCE + rng.uniform(-0.1, 0.1, len(LINES)), REFERENCE + 0.1 * float(rng.uniform())
        told = [float("nan")] * len(LINES) if k in missing else (voltages + phi[k]).tolist()
        state, output = module.step(state, x.tolist(), reference, told)
        outputs.append(output)
        x = _next(x, voltages, reference, float(load[k]))
    return state, outputs


def test_what_is_unexplained_is_the_current_of_the_lie() -> None:
    """Excess = sum_j phi_V,j / R_ij one step later, an alarm at once, and the nominal load is the run's own."""
    phi = np.zeros((150, 3))
    phi[100:, 1] = 0.05
    state, outputs = _run(_module(), np.full(150, LOAD + 0.7), phi)
    assert state.load == pytest.approx(LOAD + 0.7, abs=1e-6)
    assert max(abs(float(one.excess)) for one in outputs[20:101]) < 1e-6
    assert [float(one.excess) for one in outputs[101:]] == pytest.approx([0.05 * LINES[1]] * 49, abs=1e-6)
    assert [bool(one.monitor.alarm) for one in outputs] == [False] * 101 + [True] * 49


def test_lies_that_cancel_are_not_seen() -> None:
    """sum_j phi_V,j / R_ij = 0 leaves no residual (theory, section 8): the module alone is evaded."""
    phi = np.zeros((120, 3))
    phi[80:, 0], phi[80:, 1] = 0.5, -0.5 * LINES[0] / LINES[1]
    _, outputs = _run(_module(), np.full(120, LOAD), phi)
    assert max(abs(float(one.excess)) for one in outputs[20:]) < 1e-6
    assert not any(one.monitor.alarm for one in outputs)


def test_a_load_within_its_known_range_is_no_alarm() -> None:
    """The own load moves by up to 0.5 A: with that range known there is no alarm, without it there is."""
    load = LOAD + np.where(np.arange(150) < 80, 0.0, 0.5 * np.sin(np.arange(150)))
    assert not any(one.monitor.alarm for one in _run(_module(load_range=0.5 + 1e-6), load, np.zeros((150, 3)))[1])
    assert any(one.monitor.alarm for one in _run(_module(), load, np.zeros((150, 3)))[1])


def test_a_missing_voltage_restarts_it() -> None:
    """Without one neighbour's voltage nothing is concluded; it settles again and keeps the load it has learned."""
    state, outputs = _run(_module(), np.full(150, LOAD + 0.3), np.zeros((150, 3)), missing=frozenset({90, 91}))
    assert [int(outputs[k].monitor.phase) for k in (89, 90, 92, 125)] == [3, 1, 1, Phase.ARMED]
    assert np.isnan(np.asarray(outputs[90].monitor.residual)).all()
    assert state.load == pytest.approx(LOAD + 0.3, abs=1e-6)
    assert not any(one.monitor.alarm for one in outputs)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 1000))
def test_residual_follows_its_equation(seed: int) -> None:
    """r_t+1 = (A - L) r_t + b (dI + sum_j phi_V,j / R_ij) for any load and any lie; all modes within the decay."""
    rng = np.random.default_rng(seed)
    module = _module(_history(seed), learn_steps=0)
    load, phi = LOAD + rng.uniform(-1.0, 1.0, 30), rng.uniform(-0.1, 0.1, (30, 3))
    _, outputs = _run(module, load, phi)
    residual = np.array([one.monitor.residual for one in outputs])
    source = (load - module.design.load + phi @ LINES)[:-1, None] * TOWARD_LOAD
    np.testing.assert_allclose(residual[1:], residual[:-1] @ module.design.error.T + source, atol=1e-6)
    assert np.max(np.abs(np.linalg.eigvals(module.design.error))) <= 0.5


def test_floats_and_arrays_give_the_same_bits() -> None:
    """A node in floats and a batch of runs in arrays are the same computation."""
    module = _module()
    rng = np.random.default_rng(1)
    samples = rng.uniform(-1.0, 1.0, (30, 7, 4)) + 48.0
    samples[12, 4:6, 2] = np.nan
    batch, alone = module.init(), [module.init() for _ in range(4)]
    for own in samples:
        batch, output = module.step(batch, list(own[:3]), own[3], list(own[4:]))
        for run in range(4):
            alone[run], single = module.step(
                alone[run], own[:3, run].tolist(), float(own[3, run]), own[4:, run].tolist()
            )
            for together, one in ((output.excess, single.excess), (output.monitor.alarm, single.monitor.alarm)):
                np.testing.assert_array_equal(np.broadcast_to(together, 4)[run], one)
            for component, one in zip(output.monitor.residual, single.monitor.residual, strict=True):
                np.testing.assert_array_equal(np.broadcast_to(component, 4)[run], one)


def test_noise_in_the_history_leaves_the_lines_known() -> None:
    """With noise of 1e-3 on the recorded states the conductances are known within 5 %."""
    design = local.design(_history(samples=400, noise=1e-3), 3, {})
    assert design.conductances == pytest.approx(LINES, rel=0.05)


def test_refusals_say_what_is_missing() -> None:
    """No own measurements, no neighbour, another number of links, constant voltages: words, and a certificate."""
    one = _history().experiments[0]
    still = one.w.copy()
    still[:, 2] = 48.0
    cases = {
        "record them": Experiment(one.u, one.y, one.x, 0.01),
        "says nothing about any link": Experiment(one.u, one.y, one.x, 0.01, one.d, one.w[:, :1]),
        "expected one a link: 3": Experiment(one.u, one.y, one.x, 0.01, one.d, one.w[:, :3]),
        "neighbour 2's voltage never changes": Experiment(one.u, one.y, one.x, 0.01, one.d, still),
        "record longer": Experiment(one.u[:8], one.y[:8], one.x[:8], 0.01, one.d[:8], one.w[:8]),
    }
    for reason, experiment in cases.items():
        design = local.design(History((experiment,), 0.01), 3, {})
        assert not design.accepted
        assert reason in design.verdict
        assert json.loads(design.certificate.to_json())["accepted"] is False
        module = LocalModule(design=design, detector=build("fixed", {}, 0.01), learn_steps=5, load_range=0.0)
        _, output = module.step(module.init(), (1.0, 2.0, 3.0), 48.0, (48.0,) * 3)
        assert (output.monitor.phase, output.monitor.alarm) == (Phase.REFUSED, False)


def test_a_history_that_hides_the_lines_is_blind() -> None:
    """When noise hides how every voltage acts, the design says that it would be blind, and refuses."""
    one = _history(samples=40).experiments[0]
    told = one.w.copy()
    told[:, 1:] = np.random.default_rng(2).uniform(47.0, 49.0, (40, 3))  # not the voltages that acted
    design = local.design(History((Experiment(one.u, one.y, one.x, 0.01, one.d, told),), 0.01), 3, {})
    assert not design.accepted
    assert "does not show how" in design.verdict


def test_unknown_option_is_misuse() -> None:
    """An option that does not exist is an error that names it."""
    with pytest.raises(MonitorError, match="luenberger: option gain"):
        local.design(_history(), 3, {"gain": 1.0})
