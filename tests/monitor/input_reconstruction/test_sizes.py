"""Windows that reach as far as the plant remembers: chosen from the record, or refused with the length that does."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.history import Experiment, History
from monitor.input_reconstruction import design
from monitor.input_reconstruction.sizes import memory_of

Floats = NDArray[np.float64]
Plant = tuple[Floats, Floats, Floats, Floats]


def random_plant(generator: np.random.Generator, n: int, m: int, p: int) -> Plant:
    """A random plant of spectral radius 0.9 with feedthrough: the input shows at once."""
    A = generator.standard_normal((n, n))
    A *= 0.9 / np.max(np.abs(np.linalg.eigvals(A)))
    return A, generator.standard_normal((n, m)), generator.standard_normal((p, n)), generator.standard_normal((p, m))


def outputs(plant: Plant, u: Floats, x: Floats) -> Floats:
    """(T, p) outputs under inputs (T, m) from x."""
    A, B, C, D = plant
    rows = []
    for sample in u:
        rows.append(C @ x + D @ sample)
        x = A @ x + B @ sample
    return np.array(rows)


def record(plant: Plant, generator: np.random.Generator, samples: int, noise: float = 0.0) -> History:
    """Random inputs and what comes out."""
    u = generator.uniform(-1.0, 1.0, (samples, plant[1].shape[1]))
    y = outputs(plant, u, generator.uniform(-1.0, 1.0, len(plant[0])))
    y = y + noise * generator.standard_normal(y.shape)
    return History((Experiment(u, y, np.empty((samples, 0))),), 0.01)


def lag_of(plant: Plant) -> int:
    """Observability index: samples of y that fix the state."""
    A, _, C, _ = plant
    seen = [C]
    while np.linalg.matrix_rank(np.vstack(seen), tol=1e-8) < len(A):
        seen.append(seen[-1] @ A)
    return len(seen)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 6), p=st.integers(2, 3), past=st.integers(2, 7))
@example(seed=1, n=6, p=2, past=2)  # windows of 4 show a zero at -2.04 that longer ones do not
@example(seed=8, n=6, p=2, past=3)  # lag 3: accepted with an error of .09 when nobody looked
def test_windows_that_do_not_exceed_the_lag_are_refused_and_longer_ones_are_right(
    seed: int, n: int, p: int, past: int
) -> None:
    """On exact data: refused with the length that does, which then is accepted; what is accepted is right."""
    generator = np.random.default_rng(seed)
    plant = random_plant(generator, n, 1, p)
    history, lag = record(plant, generator, 150), lag_of(plant)
    assert memory_of(history, 1e-10).lag == lag
    made = design("cl_uie", history, {"past": past})
    assert past > lag or "too short" in made.verdict, made.verdict
    for _ in range(2):  # too short for the state, then for inputs that leave no trace over a short window
        if not made.accepted:
            found = re.search(r"past >= (\d+)", made.verdict)
            assert found is not None, made.verdict
            made = design("cl_uie", history, {"past": int(found[1])})
    assert made.observer is not None, made.verdict
    assert made.certificate.dynamics is not None
    assume(made.certificate.dynamics.spectral_radius < 0.9)
    u = 10.0 * generator.standard_normal((300, 1))
    y = outputs(plant, u, generator.standard_normal(n))
    state, found_inputs = made.observer.init((), tuple(y[0])), []
    for sample in y:
        state, out = made.observer.step(state, (), tuple(sample))
        found_inputs.append(out.estimate)
    delay = made.report.delay
    assert np.max(np.abs(np.array(found_inputs)[delay:] - u[: 300 - delay])[250:]) < 1e-5


@pytest.mark.parametrize("kind", ["op_uie", "cl_uie"])
def test_sizes_that_are_not_said_are_chosen_from_the_record(kind: str) -> None:
    """Seven states behind one output need windows longer than seven samples; without feedthrough one sample more."""
    generator = np.random.default_rng(3)
    A, B, C, D = random_plant(generator, 7, 1, 2)
    slow = (A, B, np.vstack([C[:1], 2.0 * C[:1]]), D)  # two copies of one output
    made = design(kind, record(slow, generator, 300), {})
    assert made.report.order == 7
    assert (made.report.past, made.report.delay) == (8, 0)
    later = design(kind, record((A, B, C, 0.0 * D), generator, 300), {})
    assert (made.report.order, later.report.delay) == (7, 1)


def test_a_short_record_gets_the_windows_that_it_can_bear() -> None:
    """Fewer samples than windows of five would need: the lag decides how short they may be."""
    generator = np.random.default_rng(1)
    plant = random_plant(generator, 3, 1, 3)
    assert lag_of(plant) == 1
    whole, short = (design("cl_uie", record(plant, generator, samples), {}) for samples in (100, 24))
    assert (whole.report.past, short.report.past) == (5, 2)
    assert short.accepted, short.verdict


def test_noise_does_not_hide_that_windows_are_too_short() -> None:
    """Noise 1e-5: the rank of short windows is not decided, that of longer ones is, and the refusal says so."""
    generator = np.random.default_rng(5)
    plant = random_plant(generator, 6, 1, 2)
    history = record(plant, generator, 400, 1e-5)
    made = design("cl_uie", history, {"past": 2})
    assert "too short" in made.verdict, made.verdict
    assert design("cl_uie", history, {}).accepted


def test_a_future_that_is_too_short_is_refused_with_the_one_that_does() -> None:
    """Condition (8), and what would mend it: a larger future, or nothing but more outputs."""
    generator = np.random.default_rng(1)
    A, B, C, D = random_plant(generator, 3, 1, 2)
    assert "future 2 shows it" in design("cl_uie", record((A, B, C, 0.0 * D), generator, 80), {"future": 1}).verdict
    crowded = random_plant(generator, 3, 2, 1)
    assert "more outputs are needed" in design("cl_uie", record(crowded, generator, 80), {"future": 2}).verdict


@settings(max_examples=12, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), noise=st.sampled_from([0.0, 1e-4]))
def test_units_do_not_matter(seed: int, noise: float) -> None:
    """Signals in other units, 1e-8 to 1e8: the same decision, and the gains in those units."""
    generator = np.random.default_rng(seed)
    history = record(random_plant(generator, 3, 2, 3), generator, 150, noise)
    by_u, by_y = 10.0 ** generator.uniform(-8.0, 8.0, 2), 10.0 ** generator.uniform(-8.0, 8.0, 3)
    one = history.experiments[0]
    other = replace(history, experiments=(replace(one, u=one.u * by_u, y=one.y * by_y),))
    for kind in ("op_uie", "cl_uie"):
        plain, scaled = design(kind, history, {}), design(kind, other, {})
        assert (plain.accepted, plain.report.past, plain.report.delay) == (
            scaled.accepted,
            scaled.report.past,
            scaled.report.delay,
        ), (plain.verdict, scaled.verdict)
        if plain.observer is None or scaled.observer is None:
            continue
        state = np.concatenate([np.tile(by_u, plain.report.past), np.tile(by_y, len(plain.observer.A) // 3)])
        state = state[: plain.observer.order]
        back = scaled.observer.A * state / state[:, None]
        assert np.max(np.abs(back - plain.observer.A)) < 1e-6 * np.max(np.abs(plain.observer.A))
        assert np.allclose(scaled.observer.M * state / by_u[:, None], plain.observer.M, atol=1e-6)


def test_a_record_that_changes_in_its_last_fifth_is_not_believed() -> None:
    """The plant of the unseen windows is another one: refused with the figures, which the certificate holds."""
    generator = np.random.default_rng(2)
    plant = random_plant(generator, 2, 1, 2)
    one = record(plant, generator, 200).experiments[0]
    y = one.y.copy()
    y[160:] *= 1.01
    made = design("cl_uie", History((replace(one, y=y),), 0.01), {})
    assert not made.accepted
    assert "not true on 40 unseen samples" in made.verdict
    whole = design("cl_uie", History((one,), 0.01), {})
    assert whole.accepted
    assert whole.certificate.proof is not None
    assert whole.certificate.proof.samples == 40
    assert (whole.certificate.proof.worst_error or 0.0) < 1e-10
