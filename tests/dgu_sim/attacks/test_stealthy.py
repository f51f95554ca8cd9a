"""Attacks with knowledge: each evades the module it is built against, and does what theory section 2 says."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from dgu_sim.attacker_knowledge import ScenarioKnowledge
from dgu_sim.grid import Link
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block, simulate
from monitor.baselines import Model, luenberger
from monitor.history import Experiment, History
from monitor.observers import design

SILENT = 1e-9  # residual of an attack that hides, on exact data; the observers' rounding is 2e-13
START = 300
COUPLINGS = {
    "held": (),
    "isolated": ("coupling=isolated", "secondary.enabled=false"),
}


def _run(scenario: Scenario) -> Block:
    (block,) = simulate(scenario, block_steps=scenario.steps)
    return block


def _attacked(shipped: Callable[..., Scenario], attack: str, *overrides: str) -> Scenario:
    return shipped("gallo_six_dgu", "duration_sec=6", f"attacks=[{{start_sec: 3, {attack}}}]", *overrides)


def _residuals(scenario: Scenario, block: Block, source: int, target: int) -> NDArray[np.float64]:
    """Residual of T's UIO, learned from the source's history alone, on one link; shape (steps, 3)."""
    experiments = [
        Experiment(np.zeros((len(y), 0)), y, y) for y in ScenarioKnowledge(scenario=scenario).history(source, 1)
    ]
    observer = design(
        "full_order", History(tuple(experiments), scenario.sampling_period_sec, comparable=True), {}
    ).observer
    assert observer is not None
    received = block.received[:, 0, scenario.links.index(Link(source, target))].tolist()
    state = observer.init((), received[0])
    residuals = []
    for y in received:
        state, estimate = observer.step(state, (), y)
        residuals.append(estimate.residual)
    return np.array(residuals)


@pytest.mark.parametrize("coupling", COUPLINGS)
@pytest.mark.parametrize("knowledge", ["history", "model"])
def test_plane_leaves_no_steady_residual(shipped: Callable[..., Scenario], coupling: str, knowledge: str) -> None:
    """A constant bias shows for a blip and is then gone, whether computed from data or from the model."""
    attack = f"kind: uio_stealthy_plane, links: [1-2, 5-6], voltage_v: 0.1, current_a: 0.5, knowledge: {knowledge}"
    scenario = _attacked(shipped, attack, *COUPLINGS[coupling])
    block = _run(scenario)
    for source, target in ((1, 2), (5, 6)):
        residual = np.abs(_residuals(scenario, block, source, target)).max(axis=1)
        assert residual[START : START + 3].max() > 1e-5  # ten times the smallest threshold of `fixed`
        assert residual[START + 100 :].max() < SILENT


def test_plane_of_the_isolated_dgu_is_the_published_one(shipped: Callable[..., Scenario]) -> None:
    """DGU 1 of T: (0.1, 0.1) needs 0.0258 V s and leaves < 1e-12 after a blip of 1.7e-3, theory section 3."""
    scenario = _attacked(
        shipped, "kind: uio_stealthy_plane, link: 1-2, voltage_v: 0.1, current_a: 0.1", *COUPLINGS["isolated"]
    )
    block = _run(scenario)
    phi = block.received[-1, 0, scenario.links.index(Link(1, 2))] - block.y[-1, 0, 0]
    assert phi[2] == pytest.approx(0.0258, abs=5e-5)
    residual = np.abs(_residuals(scenario, block, 1, 2)).max(axis=1)
    assert residual[START:].max() == pytest.approx(1.7e-3, abs=5e-5)
    assert residual[-1] < 1e-12
    p = scenario.dgu(1).parameters
    # rounding of y = 48 over k3 = 13.6
    assert abs((p.k1 - 1.0) * phi[0] + (p.k2 - p.R_t) * phi[1] + p.k3 * phi[2]) < 1e-11


@pytest.mark.parametrize("coupling", COUPLINGS)
@pytest.mark.parametrize("knowledge", ["history", "model"])
def test_trajectory_is_never_seen(shipped: Callable[..., Scenario], coupling: str, knowledge: str) -> None:
    """The residual stays at rounding from the first sample on, while phi reaches half an ampere."""
    attack = f"kind: uio_stealthy_trajectory, links: [1-2, 5-6], voltage_v: 0.1, current_a: 0.5, knowledge: {knowledge}"
    scenario = _attacked(shipped, attack, *COUPLINGS[coupling])
    block = _run(scenario)
    for source, target in ((1, 2), (5, 6)):
        assert np.abs(_residuals(scenario, block, source, target)[START:]).max() < SILENT
        phi = block.received[-1, 0, scenario.links.index(Link(source, target))] - block.y[-1, 0, source - 1]
        assert phi[:2] == pytest.approx([0.1, 0.5], abs=1e-12)


def test_hidden_bias_moves_the_mean_voltage_as_predicted(shipped: Callable[..., Scenario]) -> None:
    """d<V>/dt = k_I sum(phi_I) / N within 1 % (theory section 2), unseen all the way."""
    attack = "kind: uio_stealthy_trajectory, link: 1-2, current_a: 0.5, rise_sec: 0.5"
    scenario = _attacked(shipped, attack, "duration_sec=40")
    block = _run(scenario)
    mean_voltage = block.x[:, 0, :, 0].mean(axis=1)
    assert (mean_voltage[3999] - mean_voltage[1999]) / 20.0 == pytest.approx(0.1 * 0.5 / 6.0, rel=0.01)
    assert np.abs(_residuals(scenario, block, 1, 2)[START:]).max() < SILENT


def test_zero_sum_leaves_the_mean_alone_with_any_ratings(shipped: Callable[..., Scenario]) -> None:
    """Shares that add up to 0 distort the sharing; the mean voltage comes back to the mean reference."""
    attack = "attacks=[{start_sec: 5, kind: zero_sum, links: [1-2, 5-4, 6-1], shares: [0.3, -0.2, -0.1]}]"
    x = _run(shipped("consensus_six_dgu", "duration_sec=80", attack)).x[-1, 0]
    clean = _run(shipped("consensus_six_dgu", "duration_sec=80", "attacks=[]")).x[-1, 0]
    rated = [dgu.rated_current_a for dgu in shipped("consensus_six_dgu").dgus]
    assert x[:, 0].mean() == pytest.approx(clean[:, 0].mean(), abs=1e-6)  # what the slowest mode has left after 75 s
    assert np.ptp(clean[:, 1] / rated) < 1e-6
    assert np.ptp(x[:, 1] / rated) > 0.1


def test_replica_fits_the_dynamics_and_hides_the_victim(shipped: Callable[..., Scenario]) -> None:
    """No residual, and the invented load stands in the invented current while the true DGU does something else."""
    scenario = _attacked(shipped, "kind: covert, link: 1-2, load_a: 2", *COUPLINGS["isolated"])
    block = _run(scenario)
    received = block.received[:, 0, scenario.links.index(Link(1, 2))]
    assert np.array_equal(received[: START + 2], block.y[: START + 2, 0, 0])
    assert np.abs(_residuals(scenario, block, 1, 2)[START:]).max() < SILENT
    assert received[-1, 1] - block.y[-1, 0, 0, 1] == pytest.approx(2.0, abs=1e-3)


def test_coordinated_pair_is_unseen_by_the_receivers_own_observer(shipped: Callable[..., Scenario]) -> None:
    """G's module of the own state hears neighbours' voltages: alone a bias shows, with its partner it does not."""
    attacks = {
        "pair": "kind: luenberger_stealthy, links: [2-4, 3-4], voltage_v: 0.5",
        "triple": "kind: luenberger_stealthy, links: [2-4, 3-4, 5-4], voltage_v: 0.5",
        "alone": "kind: bias, link: 2-4, bias: [0.5, 0, 0]",
    }
    largest = {}
    for name, attack in attacks.items():
        scenario = _attacked(shipped, attack)
        block = _run(scenario)
        phi = {
            source: block.received[-1, 0, scenario.links.index(Link(source, 4)), 0] - block.y[-1, 0, source - 1, 0]
            for source in (2, 3, 5)
        }
        if name == "pair":  # phi_34,V = -phi_24,V A_42 / A_43 = -phi_24,V R_43 / R_42
            assert phi[3] == pytest.approx(-0.5 * 0.06 / 0.04, rel=1e-12)
        largest[name] = np.abs(_own_residual(scenario, block, 4)[START:]).max()
    assert largest["pair"] < SILENT
    assert largest["triple"] < SILENT
    assert largest["alone"] > 1e-2


def _own_residual(scenario: Scenario, block: Block, dgu: int) -> NDArray[np.float64]:
    """Residual of a Luenberger observer of one DGU that takes the received voltages for known inputs."""
    A, E = ScenarioKnowledge(scenario=scenario).model(dgu)
    observer = luenberger(Model(A=A, B=np.zeros((3, 0)), E=E, C=np.eye(3)), 0.5)
    own = scenario.grid.dgus.index(dgu)
    inflow = sum(
        conductance * block.received[:, 0, scenario.links.index(Link(source, dgu)), 0]
        for source, conductance in scenario.grid.conductances(dgu).items()
    )
    known = np.stack([block.load_current[:, 0, own] - inflow, block.reference[:, 0, own]], axis=1).tolist()
    measured = block.y[:, 0, own].tolist()
    state = observer.init(known[0], measured[0])
    residuals = []
    for u, y in zip(known, measured, strict=True):
        state, estimate = observer.step(state, u, y)
        residuals.append(estimate.residual)
    return np.array(residuals)
