"""Trials of the module of the own state: neighbours' voltages, reference and load are all measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor import local
from monitor.history import Experiment, History
from tests.fuzz.fresh import fresh_run, misfit, steps_for
from tests.fuzz.judge import Outcome, Result, acceptance, refusal
from tests.fuzz.observers import generator_of, run_observer
from tests.fuzz.oracle import Answer, evidence, judged_margin
from tests.fuzz.plants import Plant
from tests.fuzz.recordings import Needs, Recording, draw_recording

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.local import LocalDesign
    from tests.fuzz.fresh import Misfit
    from tests.fuzz.oracle import Truth

    Floats = NDArray[np.float64]

_DECAY = 0.5  # the default
_CONDUCTANCE = 1e-5  # relative, on exact data


def try_local(kind: str, seed: int) -> Result:
    """x+ = A x + b (I_L - sum_j V_j / R_ij) + e (V_ref + alpha): the residual, the decay, the conductances."""
    generator = generator_of(kind, seed)
    n, neighbours = int(generator.integers(1, 7)), int(generator.integers(1, 5))
    A = generator.standard_normal((n, n))
    A *= generator.uniform(0.2, 1.1) / max(float(np.max(np.abs(np.linalg.eigvals(A)))), 1e-3)
    b, lines = generator.standard_normal(n), 10.0 ** generator.uniform(-1.0, 1.5, neighbours)
    B = np.column_stack([np.outer(b, -lines), generator.standard_normal(n), b])  # voltages, reference, load
    m = neighbours + 2
    plant = Plant(A=A, B=B, E=np.zeros((n, 0)), C=np.eye(n), D=np.zeros((n, m)), G=np.zeros((n, 0)))
    recording = draw_recording(generator, plant, Needs(columns=n + m))
    made = local.design(_own(generator, recording.history), neighbours, {})
    truth = judged_margin(evidence(plant, recording), Answer.YES, 1.0, f"lines {lines.round(3).tolist()}")
    words = f"n={n} neighbours={neighbours} {recording.in_words}"
    if made.observer is None:
        outcome, detail = refusal(truth, made.verdict)
        return Result(kind=kind, seed=seed, outcome=outcome, detail=f"{words}: {detail}")
    exact = recording.quality not in {"noise", "single"}
    like, full = (_misfit(plant, recording, made, generator) for _ in range(2))
    outcome, detail = acceptance(truth, made.verdict, like, full, exact=exact, decay=_DECAY)
    units = recording.units.u
    expected = lines * units[-1] / units[:neighbours]
    off = float(np.max(np.abs(made.conductances / expected - 1.0)))
    if outcome is Outcome.RIGHT and truth.answer is Answer.YES and exact and off > _shown(recording, truth):
        outcome, detail = Outcome.WRONG, f"conductances {made.conductances} instead of {expected}: {detail}"
    return Result(kind=kind, seed=seed, outcome=outcome, detail=f"{words}: {detail}")


def _shown(recording: Recording, truth: Truth) -> float:
    """Relative error of a conductance that the record leaves open: a voltage that hardly moves hardly shows one."""
    return max(_CONDUCTANCE, 1e4 * truth.doubt / max(float(np.min(recording.known)), 1e-300))


def _own(generator: np.random.Generator, history: History) -> History:
    """The history as a DGU records its own: w = [load, voltages], d = [current, reference]."""
    experiments = []
    for one in history.experiments:
        voltages, reference, load = one.u[:, :-2], one.u[:, -2:-1], one.u[:, -1:]
        current = generator.standard_normal(load.shape)
        d, w = np.hstack([current, reference]), np.hstack([load, voltages])
        experiments.append(Experiment(np.empty((len(load), 0)), one.y, one.x, None, d, w))
    return History(tuple(experiments), history.sampling_period_sec)


def _misfit(plant: Plant, recording: Recording, made: LocalDesign, generator: np.random.Generator) -> Misfit:
    observer = made.observer
    assert observer is not None
    n, units = len(plant.A), recording.units
    run = fresh_run(plant, recording, generator, steps_for(observer, 2 * n, 0), full=False)
    # The module measures its state itself: y is x in the units of x.
    mine = Recording(
        history=recording.history,
        units=type(units)(u=units.u, y=units.x, x=units.x, d=units.d),
        tables=recording.tables,
        size=recording.size,
        mean=recording.mean,
        known=recording.known,
        error=recording.error,
        quality=recording.quality,
    )
    estimate, residual = run_observer(observer, mine, run)
    scale = max(float(np.max(np.abs(run.x))), 1e-300) * units.x
    return misfit(observer, (estimate - run.x) * units.x, residual * units.x, 0, (scale, scale))
