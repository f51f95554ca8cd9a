"""Trials of the input estimators that are learned from states and applied inputs: one_step, delayed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.input_estimators import design
from monitor.proof import hold_back
from tests.fuzz.fresh import fresh_run, linear_of, misfit, outputs_of, steps_for
from tests.fuzz.judge import Outcome, Result, acceptance, refusal
from tests.fuzz.observers import LARGE, generator_of, unless_like_noise
from tests.fuzz.oracle import Answer, Truth, evidence, observer_truth
from tests.fuzz.plants import Limits, Plant, draw_plant
from tests.fuzz.recordings import Needs, Recording, draw_recording
from tests.fuzz.stated import stated_figure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.input_estimators import EstimatorDesign
    from tests.fuzz.fresh import Misfit

    Floats = NDArray[np.float64]

_STRATEGY = ("is not stable", "minimum_norm")
_STEPS = 400


def try_estimator(kind: str, seed: int) -> Result:
    """Design "inputs/one_step" or "inputs/delayed", run it on fresh data, judge it."""
    method = kind.split("/")[1]
    generator = generator_of(kind, seed)
    plant = draw_plant(generator, Limits(states=8, known=0, needs_unknown=True))
    n, _, m_d, p = plant.sizes
    recording = draw_recording(generator, plant, Needs(columns=n + m_d))
    options: dict[str, object] = {}
    delay = 1
    if method == "delayed":
        delay = int(generator.integers(0, 4))
        options = {"delay": delay, "goal": "exact" if generator.random() < 0.9 else "best"}
    else:
        inner: dict[str, object] = {"allow_blind": True}
        if generator.random() < 0.7:
            inner |= {"strategy": "dual_lqr", "decay": 0.9999}
        if recording.quality in {"noise", "single"} and n > LARGE:
            inner["method"] = "total_least_squares"
        options = {"observer_options": inner}
    truth = truth_of(plant, recording, delay, 0.9999 if "decay" in str(options) else 1.0)
    made = design(method, recording.history, options)
    if made.estimator is None:
        outcome, detail = refusal(truth, made.verdict)
        if outcome in {Outcome.MISSED, Outcome.UNSAID} and any(word in made.verdict for word in _STRATEGY):
            outcome = Outcome.STRATEGY
    elif made.numbers.get("exact") is False:
        outcome, detail = _bounded(plant, recording, made, generator)
    else:
        exact = recording.quality not in {"noise", "single"}
        like, full = (fresh_misfit(plant, recording, made, delay, generator, full=full) for full in (False, True))
        stated = stated_figure(made.numbers)
        outcome, detail = acceptance(truth, made.verdict, like, full, exact=exact, stated=stated)
    words = f"n={n} m_d={m_d} p={p} {'G' if np.any(plant.G) else ''} {recording.in_words} {options}"
    return Result(kind=kind, seed=seed, outcome=outcome, detail=f"{words}: {detail}")


def truth_of(plant: Plant, recording: Recording, delay: int, radius: float) -> Truth:
    """An observer must exist, and the inputs must be told apart by what they do to the state."""
    data = unless_like_noise(plant, recording, evidence(plant, recording))
    truth = observer_truth(plant, data, delay=delay, radius=radius)
    values = np.linalg.svd(np.vstack([plant.E, plant.G]), compute_uv=False)
    apart = float(values[-1] / values[0]) if len(values) else 1.0
    if apart < 1e-10:
        return replace(truth, answer=Answer.NO, why=f"two inputs act alike; {truth.why}")
    if truth.answer is Answer.YES and (np.any(plant.G) or apart < 1e-4):
        return replace(truth, answer=Answer.OPEN)
    return truth


def fresh_misfit(
    plant: Plant,
    recording: Recording,
    made: EstimatorDesign,
    delay: int,
    generator: np.random.Generator,
    *,
    full: bool,
) -> Misfit:
    """Errors of the reconstructed inputs on a fresh run."""
    estimator = made.estimator
    assert estimator is not None
    inner = linear_of(estimator.realisation)  # type: ignore[attr-defined]
    k, units = estimator.inputs, recording.units
    skipped = delay + 2
    run = fresh_run(plant, recording, generator, steps_for(inner, k, skipped), full=full)
    rows = run.y * units.y

    def step(state: object, row: list[float]) -> tuple[object, list[object]]:
        following, found = estimator.step(state, row)  # type: ignore[arg-type]
        return following, list(found)

    found = outputs_of(step, estimator.init(rows[0].tolist()), rows)  # type: ignore[arg-type]
    error = np.full((len(rows), k), np.nan)
    error[estimator.lag :] = found[estimator.lag :] - (run.d * units.d)[: len(rows) - estimator.lag]
    size = max(float(np.max(np.abs(run.d))), float(np.max(np.abs(run.x))), float(np.max(np.abs(run.y))), 1e-300)
    alone = replace(inner, H=np.zeros((0, inner.order)), J=np.zeros((0, inner.J.shape[1])))
    nothing = np.zeros((len(rows), 0))
    return misfit(alone, error, nothing, max(skipped, estimator.lag), (size * units.d, np.zeros(0)))


def _bounded(
    plant: Plant, recording: Recording, made: EstimatorDesign, generator: np.random.Generator
) -> tuple[Outcome, str]:
    """Errors of the reconstructed inputs against their bound, with inputs within the reach of the record."""
    estimator = made.estimator
    assert estimator is not None
    inner = linear_of(estimator.realisation)  # type: ignore[attr-defined]
    radius = float(np.max(np.abs(np.linalg.eigvals(inner.A)), initial=0.0))
    if radius >= 1.0:
        return Outcome.WRONG, f"unstable: {made.verdict}"
    if plant.radius > 0.999 or radius > 0.96 or recording.quality in {"noise", "single"}:
        return Outcome.OPEN, f"bound not tried: {made.verdict}"
    # the bound is stated for inputs like those that the design has seen, not like those that were held back
    seen = hold_back(recording.history, max(estimator.lag, 1)).seen.experiments
    recorded = np.vstack([one.d[np.isfinite(one.d).all(axis=1)] for one in seen]) / recording.units.d
    reach, mean = np.max(np.abs(recorded - recorded.mean(axis=0)), axis=0), recorded.mean(axis=0)
    largest = float(np.max(np.linalg.norm((recorded - mean) / reach, axis=1)))
    d = mean + reach * largest / np.sqrt(len(reach)) * np.sign(generator.uniform(-1.0, 1.0, (_STEPS, len(reach))))
    y, x = plant.run(generator.uniform(-1.0, 1.0, len(plant.A)), np.zeros((_STEPS, 0)), d)
    state, worst = estimator.init((y[0] * recording.units.y).tolist()), np.zeros(len(reach))
    for step, sample in enumerate(y * recording.units.y):
        state, found = estimator.step(state, sample.tolist())
        if step > _STEPS // 2:
            error = np.array(found, dtype=float) - d[step - estimator.lag] * recording.units.d
            worst = np.maximum(worst, np.abs(error))
    bound = np.array(made.numbers["input_bound"])
    slack = 1e-3 * bound + 1e-5 * recording.units.d * max(1.0, float(np.max(np.abs(x))))
    told = f"errors {worst}, bounds {bound}: {made.verdict}"
    return (Outcome.WRONG if np.any(worst > bound + slack) else Outcome.RIGHT), told
