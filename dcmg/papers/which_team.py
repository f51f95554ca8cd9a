"""The distributed observer in the study `which_observer`: node 2 of the six-DGU grid, link 1-2 falsified.

All nodes run as one batch of matrix products over the runs; one node is timed in Python floats as a process runs it.
"""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from bags.watch.scenarios import load_scenario
from dcmg.papers.dduio_grid import JointGrid, announced, design_on_grid, heard, network_of
from dcmg.shipped import scenario_path
from dgu_sim.matrices import continuous_joint, discretise

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.distributed import DistributedDesign

WATCHER, WATCHED = 1, 0  # node 2 hears DGU 1
SETTLE = 600  # 0.987**600 = 4e-4 of first errors of order 1


def team_on_grid(seed: int) -> tuple[DistributedDesign, JointGrid, float]:
    """Design all nodes from one record of the jointly integrated grid; seconds that took."""
    scenario = load_scenario(scenario_path("gallo_six_dgu"))
    A, E = discretise(*continuous_joint(scenario.grid), scenario.sampling_period_sec)
    nominal = np.array([value for one in scenario.dgus for value in (one.nominal_load, one.reference_v)])
    plant = JointGrid(A=A, E=E, nominal=nominal, period_sec=scenario.sampling_period_sec)
    began = perf_counter()
    made = design_on_grid(plant, network_of(scenario.grid), np.random.default_rng((seed, 0)))
    if not made.accepted:
        raise TypeError(made.verdict)
    return made, plant, perf_counter() - began


def record_residuals(
    made: DistributedDesign,
    plant: JointGrid,
    biases: Sequence[Sequence[float]],
    sizes: tuple[int, int, int],
    noise: tuple[float, np.random.Generator],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Residuals of node 2 about DGU 1, calm and under each bias on what node 2 hears of it.

    Args:
        made: the design.
        plant: the grid.
        biases: of (V, I_t, v) on link 1-2.
        sizes: calm steps, attacked steps, runs.
        noise: standard deviation on every output, and where all draws come from.

    Returns:
        (calm steps, 3, runs) and (biases, attacked steps, 3, runs).
    """
    quiet, attacked, runs = sizes
    generator = noise[1]
    d = plant.nominal[:, None] + generator.uniform(-0.5, 0.5, (SETTLE + quiet + attacked, len(plant.nominal), runs))
    x = np.linalg.solve(np.eye(len(plant.A)) - plant.A, plant.E @ plant.nominal)[:, None] + np.zeros((1, runs))
    z = [(gains.start - gains.H @ (gains.C @ gains.start))[:, None] + np.zeros((1, runs)) for gains in made.gains]
    calm: list[NDArray[np.float64]] = []
    branches: list[tuple[list[NDArray[np.float64]], NDArray[np.float64]]] = []
    found: list[list[NDArray[np.float64]]] = [[] for _ in biases]
    for step, inputs in enumerate(d):
        measured = x + noise[0] * generator.standard_normal(x.shape)
        if step < SETTLE + quiet:
            z, residual = _step(made, z, measured, inputs, np.zeros(3))
            if step >= SETTLE:
                calm.append(residual)
        else:
            branches = branches or [(list(z), np.array(bias)) for bias in biases]
            for number, (states, bias) in enumerate(branches):
                following, residual = _step(made, states, measured, inputs, bias)
                branches[number] = (following, bias)
                found[number].append(residual)
        x = plant.A @ x + plant.E @ inputs
    return np.array(calm), np.array(found)


def _step(
    made: DistributedDesign,
    z: Sequence[NDArray[np.float64]],
    measured: NDArray[np.float64],
    inputs: NDArray[np.float64],
    bias: NDArray[np.float64],
) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """One step of D (6) of all nodes, and node 2's residual about DGU 1."""
    network, outputs, estimates = made.network, [], []
    for node, gains in enumerate(made.gains):
        y = measured[heard(network, node)].copy()
        if node == WATCHER:
            at = heard(network, node).index(3 * WATCHED)
            y[at : at + 3] += bias[:, None]
        outputs.append(y)
        estimates.append(z[node] + gains.H @ y)
    following = []
    for node, (gains, y) in enumerate(zip(made.gains, outputs, strict=True)):
        others = sum((estimates[one] - estimates[node] for one in network.neighbours(node)), np.zeros_like(z[node]))
        known = inputs[announced(network, node)]
        following.append(gains.E @ z[node] + gains.F @ known + gains.L @ y + gains.chi * others)
    at = heard(network, WATCHER).index(3 * WATCHED)
    residual = outputs[WATCHER] - made.gains[WATCHER].C @ estimates[WATCHER]
    return following, residual[at : at + 3]


def step_time_us(made: DistributedDesign, steps: int) -> float:
    """Best of five mean times of a whole step of node 2 in Python floats [us]."""
    observer = made.observers[WATCHER]
    p, m = made.gains[WATCHER].C.shape[0], made.gains[WATCHER].F.shape[1]
    y, u = (1.0,) * p, (1.0,) * m
    best = np.inf
    for _ in range(5):
        state = observer.init(y)
        began = perf_counter()
        for _ in range(steps):
            estimate = observer.output(state, y).estimate
            state = observer.step(state, u, y, estimate, [(estimate, True) for _ in observer.neighbours])
        best = min(best, (perf_counter() - began) / steps)
    return 1e6 * best


def floats_heard(made: DistributedDesign) -> int:
    """Numbers that node 2 receives in a step: outputs of its neighbours, their estimates, announced inputs."""
    neighbours, gains = len(made.network.neighbours(WATCHER)), made.gains[WATCHER]
    return 3 * neighbours + len(gains.E) * neighbours + int(gains.F.shape[1])
