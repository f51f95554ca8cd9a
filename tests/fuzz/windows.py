"""Trials of what is learned from outputs and applied inputs alone: op_uie, cl_uie, as observers and as estimators."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from monitor import input_estimators, observers
from tests.fuzz.fresh import fresh_run, linear_of, misfit, outputs_of, steps_for
from tests.fuzz.judge import Outcome, Result, acceptance, refusal
from tests.fuzz.observers import generator_of, is_blind
from tests.fuzz.oracle import Answer, Evidence, Truth, judged_margin
from tests.fuzz.plants import Limits, Plant, draw_plant
from tests.fuzz.recordings import Needs, Recording, complete, draw_recording
from tests.fuzz.stated import stated_error, stated_figure
from tests.fuzz.zeros import zero_margins

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.observers import LinearObserver
    from tests.fuzz.fresh import Misfit

    Floats = NDArray[np.float64]

_STRATEGY = ("is not stable", "finds no stable op-UIE")
_PAST, _FUTURE = 5, {"observer": 1, "estimator": 2}


def try_windows(kind: str, seed: int) -> Result:
    """Design an input estimator (kind "uie/observer/cl_uie" or "uie/estimator/op_uie"), run it, judge it."""
    _, role, method = kind.split("/")
    generator = generator_of(kind, seed)
    limits = Limits(states=8, known=1 if role == "observer" else 0, unknown=2, radius=1.03, needs_unknown=True)
    plant = all_unknown(draw_plant(generator, limits))
    options: dict[str, object] = {}
    past, future = _PAST, _FUTURE[role]
    if generator.random() < 0.7:
        past, future = int(generator.integers(2, 8)), int(generator.integers(1, 5))
        options = {"past": past, "future": future}
    n, _, m_d, p = plant.sizes
    rows = max((past + 1) * m_d + (past + future) * p, n + (past + future) * m_d)
    recording = draw_recording(generator, plant, Needs(columns=rows, shortest=past + future))
    truth = window_truth(plant, recording, past, future, chosen=bool(options))
    if not options:
        longer = window_truth(plant, recording, max(_PAST, n), max(_PAST, n + 1))
        truth = truth if truth.answer is longer.answer else replace(truth, answer=Answer.OPEN)
    made: observers.Design | input_estimators.EstimatorDesign
    if role == "observer":
        made = observers.design(method, recording.history, options)
    else:
        made = input_estimators.design(method, recording.history, options)
    outcome, detail = judge_windows(plant, recording, made, truth, memory=past + future, generator=generator)
    words = f"n={n} inputs={m_d} p={p} {'G' if np.any(plant.G) else ''} {recording.in_words} {options}"
    return Result(kind=kind, seed=seed, outcome=outcome, detail=f"{words}: {detail}")


def all_unknown(plant: Plant) -> Plant:
    """The plant with its known inputs among the unknown ones: a link carries none."""
    n, _, _, p = plant.sizes
    return replace(
        plant,
        B=np.zeros((n, 0)),
        D=np.zeros((p, 0)),
        E=np.hstack([plant.B, plant.E]),
        G=np.hstack([plant.D, plant.G]),
    )


def window_truth(plant: Plant, recording: Recording, past: int, future: int, *, chosen: bool = False) -> Truth:
    """Condition (8) of I on the true plant, its zeros on the observable part, and the excitation of the windows."""
    data = _evidence(plant, recording, past + future)
    Theta, T = _window(plant, past + future)
    m_d = plant.E.shape[1]
    now = T[:, past * m_d : (past + 1) * m_d]
    hiding = np.hstack([Theta, T[:, (past + 1) * m_d :]])
    left, values, _ = np.linalg.svd(hiding)
    count = int(np.count_nonzero(values > 1e-9 * max(float(values[0]), 1.0)))
    seen = left[:, count:].T @ now
    kernel = float(np.linalg.svd(seen, compute_uv=False)[-1]) if len(seen) >= m_d else 0.0
    kernel /= max(1.0, float(np.linalg.norm(now, 2)))
    if kernel < 1e-10:
        return judged_margin(data, Answer.NO, 1.0, "condition (8) fails")
    if chosen and past <= _lag(plant):
        return judged_margin(data, Answer.NO, 1.0, f"past is not longer than the lag {_lag(plant)}")
    V, margin = _observable(plant)
    zeros = zero_margins(V.T @ plant.A @ V, V.T @ plant.E, plant.C @ V, plant.G, 1.0)
    if zeros.outside < 1e-10 and zeros.circle > 1e-8:
        return judged_margin(data, Answer.NO, min(zeros.circle, margin), "a zero lies outside the circle")
    least = min(kernel, zeros.least, margin)
    return judged_margin(data, Answer.YES, least, f"margins: (8) {kernel:.1e}, zeros {zeros.least:.1e}")


def _window(plant: Plant, length: int) -> tuple[Floats, Floats]:
    """Y = Theta x_0 + T U over a window."""
    n, _, m_d, p = plant.sizes
    powers = [np.eye(n)]
    for _ in range(length):
        powers.append(plant.A @ powers[-1])
    response = [plant.G, *(plant.C @ power @ plant.E for power in powers)]
    T = np.zeros((length * p, length * m_d))
    for row in range(length):
        for column in range(row + 1):
            T[row * p : (row + 1) * p, column * m_d : (column + 1) * m_d] = response[row - column]
    return np.vstack([plant.C @ power for power in powers[:length]]), T


def _lag(plant: Plant) -> int:
    """Samples of y that fix what is observable of the state."""
    n, p = len(plant.A), len(plant.C)
    Theta, _ = _window(plant, n)
    tolerance = 1e-9 * float(np.linalg.norm(Theta, 2))
    ranks = [np.linalg.matrix_rank(Theta[: p * (count + 1)], tol=tolerance) for count in range(n)]
    return ranks.index(ranks[-1]) + 1


def _observable(plant: Plant) -> tuple[Floats, float]:
    """Orthonormal basis of what outputs show of the state, and how clearly the rest is hidden."""
    n = len(plant.A)
    Theta, _ = _window(plant, n)
    right, values = np.linalg.svd(Theta)[2], np.linalg.svd(Theta, compute_uv=False)
    rank = int(np.count_nonzero(values > 1e-9 * values[0]))
    return right[:rank].T, float(values[rank - 1] / max(values[0], 1.0)) if rank else 1.0


def _evidence(plant: Plant, recording: Recording, length: int) -> Evidence:
    """Spread of [u of the window; observable x at its start] over the true record."""
    V, _ = _observable(plant)
    columns = []
    for (_, x, d), one in zip(recording.tables, recording.history.experiments, strict=False):
        whole = complete(one.y, one.d)
        columns += [
            np.concatenate([d[start : start + length].ravel(), x[start] @ V])
            for start in range(len(x) - length + 1)
            if whole[start : start + length].all()
        ]
    span = length * plant.E.shape[1] + V.shape[1]
    if len(columns) < span:
        return Evidence(error=1.0, spare=len(columns) - span, span=span)
    rows = np.array(columns).T
    rows = rows / np.maximum(np.sqrt(np.mean(rows**2, axis=1, keepdims=True)), 1e-300)
    values = np.linalg.svd(rows, compute_uv=False)
    error = recording.error / max(float(recording.size.min(initial=1.0)), 1e-300)
    return Evidence(error=error * float(values[0] / max(values[-1], 1e-300)), spare=len(columns) - span, span=span)


def judge_windows(
    plant: Plant,
    recording: Recording,
    made: observers.Design | input_estimators.EstimatorDesign,
    truth: Truth,
    *,
    memory: int,
    generator: np.random.Generator,
) -> tuple[Outcome, str]:
    """Judge a design of either role."""
    if not made.accepted:
        outcome, detail = refusal(truth, made.verdict)
        hard = outcome in {Outcome.MISSED, Outcome.UNSAID}
        if hard and "blind" in made.verdict and is_blind(plant):
            return Outcome.AGREED, detail
        return (Outcome.STRATEGY if hard and any(word in made.verdict for word in _STRATEGY) else outcome), detail
    exact = recording.quality not in {"noise", "single"}
    like, full = (_misfit(plant, recording, made, memory, generator, full=full) for full in (False, True))
    stated = stated_error(made.certificate) if isinstance(made, observers.Design) else stated_figure(made.numbers)
    outcome, detail = acceptance(truth, made.verdict, like, full, exact=exact, stated=stated)
    if outcome is Outcome.WRONG and truth.answer in {Answer.UNTOLD, Answer.OPEN} and "spare columns" in truth.why:
        hidden = truth.doubt >= 1e-3 and not re.search(r"-\d+ spare", truth.why)
        outcome = Outcome.OPEN if hidden else outcome  # without states nobody knows of a mode that never moved
    return outcome, detail


def _misfit(
    plant: Plant,
    recording: Recording,
    made: observers.Design | input_estimators.EstimatorDesign,
    memory: int,
    generator: np.random.Generator,
    *,
    full: bool,
) -> Misfit:
    """Errors of the reconstructed inputs, or the residual of an observer that estimates none."""
    is_observer = isinstance(made, observers.Design)
    observer = made.observer if isinstance(made, observers.Design) else made.estimator.realisation  # type: ignore[union-attr]
    inner: LinearObserver = linear_of(observer)
    k, units = (0 if is_observer else plant.E.shape[1]), recording.units
    run = fresh_run(plant, recording, generator, steps_for(inner, k + len(units.y), memory), full=full)
    rows = run.y * units.y

    def step(state: object, row: list[float]) -> tuple[object, list[object]]:
        following, output = observer.step(state, (), row)  # type: ignore[union-attr, arg-type]
        return following, [*output.estimate[:k], *output.residual]

    found = outputs_of(step, observer.init((), rows[0].tolist()), rows)  # type: ignore[union-attr, arg-type]
    lag = 0 if is_observer else made.estimator.lag  # type: ignore[union-attr]
    error = np.full((len(rows), k), np.nan)
    error[lag:] = found[lag:, :k] - (run.d * units.d)[: len(rows) - lag, :k] if k else 0.0
    size = max(float(np.max(np.abs(run.d))), float(np.max(np.abs(run.y))), 1e-300)
    scales = (size * units.d)[:k], size * units.y
    return misfit(inner, error, found[:, k:], max(memory, lag), scales)
