"""Reconstructing inputs from outputs: existence, convergence, refusals, noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.detectors import build
from monitor.errors import MonitorError
from monitor.history import Experiment, History
from monitor.input_reconstruction import InputDesign, design, impose
from monitor.input_reconstruction.attacks import with_attack
from monitor.link_monitor import LinkMonitor

Floats = NDArray[np.float64]
Plant = tuple[Floats, Floats, Floats, Floats]


def simulate(plant: Plant, u: Floats, x: Floats) -> Floats:
    """Outputs of a plant (A, B, C, D) under inputs (T, m)."""
    A, B, C, D = plant
    rows = []
    for sample in u:
        rows.append(C @ x + D @ sample)
        x = A @ x + B @ sample
    return np.array(rows)


def record(plant: Plant, generator: np.random.Generator, samples: int = 80, noise: float = 0.0) -> History:
    """A record of random inputs from a random start."""
    u = generator.uniform(-1.0, 1.0, (samples, plant[1].shape[1]))
    y = simulate(plant, u, generator.uniform(-1.0, 1.0, len(plant[0])))
    noisy = Experiment(u, y + noise * generator.standard_normal(y.shape), np.empty((samples, 0)))
    return History((noisy,), 0.01, comparable=True)


def reconstruct(made: InputDesign, y: Floats) -> Floats:
    """Estimates, one for each output sample."""
    assert made.observer is not None, made.verdict
    state, rows = made.observer.init((), tuple(y[0])), []
    for sample in y:
        state, output = made.observer.step(state, (), tuple(sample))
        rows.append(np.array(output.estimate))
    return np.array(rows)


def stable_plant(generator: np.random.Generator, n: int, m: int, p: int, *, direct: bool) -> Plant:
    """A random plant with spectral radius 0.9."""
    A = generator.standard_normal((n, n))
    A *= 0.9 / np.max(np.abs(np.linalg.eigvals(A)))
    D = generator.standard_normal((p, m)) if direct else np.zeros((p, m))
    return A, generator.standard_normal((n, m)), generator.standard_normal((p, n)), D


def invariant_zeros(plant: Plant) -> NDArray[np.complex128]:
    """Invariant zeros of a square plant with invertible D: eigenvalues of A - B D^-1 C."""
    A, B, C, D = plant
    return np.linalg.eigvals(A - B @ np.linalg.solve(D, C)).astype(np.complex128)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 4), m=st.integers(1, 2))
def test_existence_is_told_as_the_zeros_of_the_model_decide_it(seed: int, n: int, m: int) -> None:
    """The zeros come out of the record, and a design is refused exactly when one lies outside the unit circle."""
    generator = np.random.default_rng(seed)
    plant = stable_plant(generator, n, m, m, direct=True)
    zeros = invariant_zeros(plant)
    assume(np.linalg.cond(plant[3]) < 30.0)
    assume(np.max(np.abs(zeros)) < 5.0)  # much faster zeros drown in rounding within a window
    assume(np.all(np.abs(np.abs(zeros) - 1.0) > 0.02))
    made = design("cl_uie", record(plant, generator), {"past": n + 1})
    found = made.report.zeros
    assume(made.report.order == n)  # a nearly unobservable or uncontrollable plant shows a smaller order
    assert found is not None
    # Roundings of size 1e-12 are amplified by the conditioning of the zeros, 1e5 at worst in these draws.
    assert np.allclose(np.sort(np.abs(found)), np.sort(np.abs(zeros)), rtol=1e-4, atol=1e-4)
    assert made.accepted == bool(np.max(np.abs(zeros)) < 1.0)
    if not made.accepted:
        assert "zeros" in made.verdict


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), kind=st.sampled_from(["op_uie", "cl_uie"]), direct=st.booleans())
def test_accepted_estimators_converge_to_arbitrary_inputs(seed: int, kind: str, direct: bool) -> None:  # noqa: FBT001 - drawn
    """With more outputs than inputs there are no zeros: the estimate reaches inputs that the record never showed."""
    generator = np.random.default_rng(seed)
    plant = stable_plant(generator, 3, 1, 2, direct=direct)
    future = 1 if direct else 2
    made = design(kind, record(plant, generator), {"past": 4, "future": future})
    assume(made.accepted)
    assert made.certificate.dynamics is not None
    radius = made.certificate.dynamics.spectral_radius
    assume(radius < 0.85)
    assert made.report.visibility is not None
    assume(made.report.visibility > 1e-2)
    u = 50.0 * np.sign(generator.standard_normal((200, 1))) + 10.0
    y = simulate(plant, u, 10.0 * generator.standard_normal(3))
    error = reconstruct(made, y)[made.report.delay :] - u[: 200 - made.report.delay]
    # 0.85**150 = 3e-11 of a first error of order 1e3, times the conditioning 1e2 of the window.
    assert np.max(np.abs(error[150:])) < 1e-5


def test_the_gains_satisfy_their_equations_on_the_record() -> None:
    """U_f = [U1 Y1] H and A_op = [shift; U1] hold on every window of exact data, for every pole choice."""
    plant = stable_plant(np.random.default_rng(4), 3, 1, 2, direct=True)
    history = record(plant, np.random.default_rng(5))
    for options in ({"poles": "minimum_norm"}, {"poles": "lmi"}):
        made = design("op_uie", history, {"past": 4, **options})
        assert made.accepted, made.verdict
        assert made.report.fit is not None
        assert made.report.fit < 1e-9  # rounding times the LMI's gain
        assert made.certificate.matrices is not None
        A_op, U1 = made.certificate.matrices["A_op"], made.certificate.matrices["U1"]
        assert np.array_equal(A_op[:-1], np.eye(3, 4, k=1))
        assert np.array_equal(A_op[-1:], U1)


def test_lmi_poles_are_never_slower_than_the_pseudo_inverse() -> None:
    """Choosing within all solutions brings the spectral radius down to the largest zero, here none at all."""
    generator = np.random.default_rng(11)
    for _ in range(3):
        history = record(stable_plant(generator, 3, 1, 2, direct=True), generator)
        plain, chosen = (design("op_uie", history, {"past": 4, "poles": poles}) for poles in ("minimum_norm", "lmi"))
        assert chosen.certificate.dynamics is not None, chosen.verdict
        if plain.certificate.dynamics is not None:
            assert chosen.certificate.dynamics.spectral_radius <= plain.certificate.dynamics.spectral_radius + 1e-9


def test_an_input_that_does_not_show_in_time_is_refused_by_condition_8() -> None:
    """With D = 0 the input shows one sample later: future 1 fails condition (8), future 2 does not."""
    plant = stable_plant(np.random.default_rng(1), 3, 1, 2, direct=False)
    history = record(plant, np.random.default_rng(2))
    refused = design("cl_uie", history, {"past": 4, "future": 1})
    assert not refused.accepted
    assert "condition (8)" in refused.verdict
    assert design("cl_uie", history, {"past": 4, "future": 2}).accepted


def test_more_inputs_than_outputs_are_refused() -> None:
    """Two inputs cannot be told from one output, however many samples are used."""
    plant = stable_plant(np.random.default_rng(1), 3, 2, 1, direct=True)
    made = design("cl_uie", record(plant, np.random.default_rng(2)), {"past": 4, "future": 3})
    assert not made.accepted
    assert "condition (8)" in made.verdict


def test_noisy_records_keep_order_zeros_and_accuracy() -> None:
    """A record with noise 1e-3 shows the same order, nearly the same zeros, and errors as the noise gain predicts."""
    plant = (
        np.diag([0.8, 0.5]),
        np.array([[1.0], [1.0]]),
        np.array([[1.0, 0.5], [0.3, 1.0]]),
        np.array([[1.0], [0.5]]),
    )
    generator = np.random.default_rng(7)
    exact = design("cl_uie", record(plant, generator), {"past": 3})
    noisy = design("cl_uie", record(plant, generator, 400, 1e-3), {"past": 3})
    assert noisy.report.order == exact.report.order == 2
    assert exact.report.noise_gain is not None
    u = generator.uniform(-1.0, 1.0, (4000, 1))
    y = simulate(plant, u, np.zeros(2)) + 1e-3 * generator.standard_normal((4000, 2))
    spread = np.std((reconstruct(exact, y) - u)[100:])
    # 3900 correlated samples tell a standard deviation to about 5 %.
    assert spread == pytest.approx(exact.report.uncertainty(1e-3)[0], rel=0.1)
    assert np.std((reconstruct(noisy, y) - u)[100:]) < 1.1 * spread


def test_least_squares_promises_neither_order_nor_zeros() -> None:
    """The plain pseudo-inverse of noisy data works but says that nothing was decided."""
    plant = stable_plant(np.random.default_rng(4), 3, 1, 2, direct=True)
    made = design("cl_uie", record(plant, np.random.default_rng(5), 80, 1e-2), {"past": 4, "fit": "least_squares"})
    assert made.accepted
    assert made.report.order is None
    assert made.report.zeros is None
    assert "not decided" in made.verdict


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"samples": 9}, "record longer"),
        ({"constant": True}, "not exciting"),
        ({"nan": True}, "NaN"),
        ({"no_inputs": True}, "0 inputs"),
    ],
)
def test_bad_records_are_refused_in_one_line(change: dict[str, object], expected: str) -> None:
    """Too short, constant, full of gaps or without inputs: the verdict says which and is one line."""
    generator = np.random.default_rng(0)
    plant = stable_plant(generator, 3, 1, 2, direct=True)
    experiment = record(plant, generator, 9 if "samples" in change else 60).experiments[0]
    u, y = experiment.u.copy(), experiment.y.copy()
    if "constant" in change:
        u[:] = 1.0
    if "nan" in change:
        y[::4] = np.nan
    if "no_inputs" in change:
        u = np.empty((len(u), 0))
    made = design("cl_uie", History((Experiment(u, y, np.empty((len(u), 0))),), 0.01), {"past": 4})
    assert not made.accepted
    assert expected in made.verdict
    assert "\n" not in made.verdict


def test_unknown_kinds_and_options_are_misuse() -> None:
    """A wrong kind or option raises, naming what was found."""
    history = record(stable_plant(np.random.default_rng(0), 2, 1, 2, direct=True), np.random.default_rng(0))
    with pytest.raises(MonitorError, match="'uie'"):
        design("uie", history, {})
    with pytest.raises(MonitorError, match="past"):
        design("cl_uie", history, {"past": 1})


def test_windows_with_gaps_are_dropped_and_experiments_stacked() -> None:
    """Two experiments side by side, one with a missing sample, give the same gains as one whole record."""
    plant = stable_plant(np.random.default_rng(4), 3, 1, 2, direct=True)
    first, second = (record(plant, np.random.default_rng(seed)).experiments[0] for seed in (1, 2))
    y = second.y.copy()
    y[30, 0] = np.nan
    made = design("cl_uie", History((first, Experiment(second.u, y, second.x)), 0.01, comparable=True), {"past": 4})
    whole = design("cl_uie", History((first,), 0.01, comparable=True), {"past": 4})
    assert made.report.dropped == 5  # windows of 5 samples that hold the missing one
    assert made.certificate.matrices is not None
    assert whole.certificate.matrices is not None
    # Two records of one plant agree to rounding times the conditioning of the windows.
    assert np.allclose(made.certificate.matrices["U1"], whole.certificate.matrices["U1"], atol=1e-9)


def test_floats_and_arrays_step_to_the_same_bits() -> None:
    """A thousand runs in arrays are a thousand runs in floats."""
    plant = stable_plant(np.random.default_rng(4), 3, 1, 2, direct=True)
    made = design("cl_uie", record(plant, np.random.default_rng(5)), {"past": 4})
    assert made.observer is not None
    y = np.random.default_rng(6).standard_normal((30, 2, 5))
    alone = [reconstruct(made, y[:, :, run])[-1] for run in range(5)]
    state = made.observer.init((), tuple(y[0]))
    for sample in y:
        state, output = made.observer.step(state, (), tuple(sample))
    assert np.array_equal(np.array(output.estimate).T, np.array(alone))


def test_an_imposed_input_replaces_the_newest_estimate() -> None:
    """Imposing the true input at every step leaves the true past inputs in the state."""
    plant = stable_plant(np.random.default_rng(4), 3, 1, 2, direct=True)
    made = design("op_uie", record(plant, np.random.default_rng(5)), {"past": 4})
    assert made.observer is not None
    u = np.random.default_rng(6).standard_normal((10, 1))
    y = simulate(plant, u, np.zeros(3))
    state = made.observer.init((), tuple(y[0]))
    for sample, known in zip(y, u, strict=True):
        state, _ = made.observer.step(state, (), tuple(sample))
        state = impose(state, tuple(known), made.report.past)
    assert np.array_equal(np.array(state[:4]), u[-4:, 0])


def test_an_attack_on_one_output_is_reconstructed_next_to_the_inputs() -> None:
    """A record widened by an attack of our own making gives an estimator of inputs and attack alike."""
    plant = stable_plant(np.random.default_rng(8), 3, 1, 3, direct=False)
    history = with_attack(record(plant, np.random.default_rng(9), 120), (1,), spread=1.0, seed=0)
    made = design("cl_uie", history, {"past": 4, "future": 2})
    assert made.accepted, made.verdict
    u = np.random.default_rng(10).standard_normal((150, 1))
    y = simulate(plant, u, np.zeros(3))
    y[60:, 1] += 0.25
    found = reconstruct(made, y)
    assert np.allclose(found[1:60, 1][40:], 0.0, atol=1e-6)
    assert np.allclose(found[120:, 1], 0.25, atol=1e-6)


def test_it_runs_as_a_link_monitor_and_restarts_after_a_gap() -> None:
    """Under the one protocol: the estimate is the input; a missing sample restarts the estimator."""
    plant = stable_plant(np.random.default_rng(4), 3, 1, 2, direct=True)
    made = design("cl_uie", record(plant, np.random.default_rng(5)), {"past": 4}).as_design()
    monitor = LinkMonitor(made.observer, build("fixed", {"settle_sec": 0.1, "calibrate_sec": 0.2}, 0.01))
    u = np.random.default_rng(6).standard_normal((300, 1))
    y = simulate(plant, u, np.zeros(3))
    state, found = monitor.init(), []
    for step, sample in enumerate(y):
        state, output = monitor.step(state, tuple(float(one) for one in sample), delivered=step != 150)
        found.append(float(np.asarray(output.estimate[0])))
    assert np.isnan(found[150])
    assert np.isfinite(found[151])
    assert np.allclose(np.array(found)[[149, 299]], u[[149, 299], 0], atol=1e-6)


def test_noise_that_hides_the_input_is_named_as_the_reason() -> None:
    """An input that acts 30 times weaker than the other, under noise 1e-2: not refused as impossible, but as hidden."""
    generator = np.random.default_rng(0)
    A, B, C, D = stable_plant(generator, 3, 2, 2, direct=False)
    weak = record((A, B * np.array([1.0, 0.03]), C, D), generator, samples=200, noise=0.01)
    made = design("cl_uie", weak, {"future": 2, "order": 3})
    assert not made.accepted
    assert "cannot be told from noise" in made.verdict
    forced = design("cl_uie", weak, {"future": 2, "fit": "least_squares"})
    assert "inputs error" in forced.verdict  # designed all the same, it is off by more than the weak input moves
    assert not forced.accepted
