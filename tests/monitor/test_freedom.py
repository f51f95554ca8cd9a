"""Uses of the freedom Q: what is asked for comes out, or the refusal says why not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_lyapunov

from monitor.observers import LinearObserver, design
from monitor.sight import accumulated, convergence_steps

if TYPE_CHECKING:
    from collections.abc import Callable

    from monitor.history import History
    from tests.monitor.conftest import RandomCase

REASONS = (
    "T (13) fails",
    "unstable zeros",
    "cannot be reached",
    "cannot be placed accurately",
    "nothing is left to optimise",
    "sets no noise budget",
    "within the noise budget",
    "blind: ",
)


@pytest.mark.parametrize("strategy", ["dual_lqr", "pole_placement", "max_sensitivity"])
@pytest.mark.parametrize("kind", ["full_order", "reduced_order"])
def test_random_plants_get_the_decay_or_a_reason(random_cases: list[RandomCase], kind: str, strategy: str) -> None:
    """Every accepted observer solves the data equation within its decay; every refusal has one of the known reasons."""
    decay = 0.6
    for case in random_cases[:100]:
        made = design(kind, case.history, {"strategy": strategy, "decay": decay, "allow_blind": True})
        dynamics = made.certificate.dynamics
        if not made.accepted:
            assert any(reason in made.verdict for reason in REASONS), made.verdict
            continue
        assert dynamics is not None
        if strategy != "max_sensitivity":  # which leaves fixed eigenvalues where they are
            assert dynamics.spectral_radius <= decay + 1e-3  # poles count as placed when 1e-3 off
        assert dynamics.kernel_residual < 1e-6


def test_poles_are_placed(dgu_history: Callable[..., History]) -> None:
    """All three eigenvalues of a DGU's observer go where they are asked to."""
    made = design("full_order", dgu_history(1), {"strategy": "pole_placement", "poles": (0.5, -0.2, 0.1)})
    assert made.certificate.dynamics is not None
    assert np.allclose(np.sort(made.certificate.dynamics.eigenvalues[:, 0]), [-0.2, 0.1, 0.5], atol=1e-9)


def test_wrong_number_of_poles(dgu_history: Callable[..., History]) -> None:
    """The line says how many can be moved."""
    made = design("full_order", dgu_history(1), {"strategy": "pole_placement", "poles": (0.5,)})
    assert made.verdict == "refused: 1 poles are given, expected 3: that many eigenvalues of A_UIO can be moved"


@pytest.mark.parametrize("number", range(1, 7))
@pytest.mark.parametrize("decay", [0.3, 0.9])
def test_no_other_choice_at_this_decay_sees_more(
    dgu_history: Callable[..., History], number: int, decay: float
) -> None:
    """A DGU's residual has rank one: at equal noise no rescaled parity row with A_UIO = decay I beats the programme.

    r+ = decay r + g rho with a free vector g: the gain along the visible direction, for a noise gain proportional to
    |g|, is largest for g along it. The optimum is known in closed form and must be reached.
    """
    made = design("full_order", dgu_history(number), {"strategy": "max_sensitivity", "decay": decay})
    report = made.certificate.residual
    assert report is not None
    left, values, right = np.linalg.svd(report.dc_gain)
    assert np.allclose(np.abs(left[:, 0] @ right[0]), 1.0, atol=1e-6)
    assert values[1] < 1e-6 * values[0]
    plain = design("full_order", dgu_history(number), {}).certificate.residual
    assert plain is not None
    assert np.trace(report.noise_gain) == pytest.approx(np.trace(plain.noise_gain), rel=1e-6)


def test_noise_budget_scales_the_gain(dgu_history: Callable[..., History]) -> None:
    """Half the noise budget leaves half the gain: the ratio is what a strategy can improve."""
    gains = []
    for budget in (1.0, 0.5):
        made = design("full_order", dgu_history(1), {"strategy": "max_sensitivity", "noise_budget": budget})
        assert made.certificate.residual is not None
        gains.append(np.linalg.norm(made.certificate.residual.dc_gain, 2))
    assert gains[1] == pytest.approx(gains[0] / 2.0, rel=1e-5)


def test_strategies_share_the_invisible_biases(dgu_history: Callable[..., History]) -> None:
    """No Q shows a bias that the plant itself could produce."""
    plain = design("full_order", dgu_history(1), {}).certificate.residual
    assert plain is not None
    for strategy in ("dual_lqr", "pole_placement", "max_sensitivity"):
        other = design("full_order", dgu_history(1), {"strategy": strategy}).certificate.residual
        assert other is not None
        assert np.max(np.abs(other.dc_gain @ plain.invisible_bias)) < 1e-6


@given(st.integers(0, 10_000))
def test_doubling_solves_the_lyapunov_equation(seed: int) -> None:
    """P = A P A' + Q, as scipy solves it."""
    generator = np.random.default_rng(seed)
    n = int(generator.integers(1, 6))
    A = generator.standard_normal((n, n))
    A *= 0.95 / np.max(np.abs(np.linalg.eigvals(A)))
    B = generator.standard_normal((n, 2))
    expected = solve_discrete_lyapunov(A, B @ B.T)
    assert np.allclose(accumulated(A, B @ B.T), expected, rtol=1e-8, atol=1e-8 * np.max(np.abs(expected)))


@pytest.mark.parametrize(("radius", "steps"), [(0.0, 1), (0.5, 7), (0.09, 2), (0.999, 4603)])
def test_convergence_is_counted_exactly(radius: float, steps: int) -> None:
    """Smallest k with radius^k <= 1 %."""
    assert convergence_steps(np.diag([radius, radius / 2.0])) == steps


def test_linear_observer_lays_out_its_matrices(dgu_history: Callable[..., History]) -> None:
    """One step is the four products of its equations."""
    observer = design("full_order", dgu_history(1), {}).observer
    assert isinstance(observer, LinearObserver)
    z, y = np.array([1.0, 2.0, 3.0]), np.array([47.0, 9.0, 11.0])
    following, output = observer.step(tuple(z), (), tuple(y))
    assert np.allclose(np.array(following), observer.A @ z + observer.B @ y, rtol=1e-14)
    assert np.allclose(np.array(output.estimate), observer.M @ z + observer.D @ y, rtol=1e-14)
    assert np.allclose(np.array(output.residual), observer.H @ z + observer.J @ y, rtol=1e-13, atol=1e-13)
