"""Trials of the unknown-input observers that cancel what they do not know: full and reduced order, delayed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np

from monitor.observers import design
from tests.fuzz.bounded import bounded_outcome
from tests.fuzz.fresh import Misfit, Run, fresh_run, linear_of, misfit, outputs_of, steps_for
from tests.fuzz.judge import Outcome, Result, acceptance, refusal
from tests.fuzz.oracle import UNCLEAR, Answer, Evidence, Truth, effective, evidence, observer_truth
from tests.fuzz.plants import Limits, Plant, draw_plant, rank_of
from tests.fuzz.recordings import Needs, Recording, draw_recording
from tests.fuzz.stated import stated_error
from tests.fuzz.units import Twin, depends, twin_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.observers import Design, Observer

    Floats = NDArray[np.float64]

LARGE = 5  # states
_TWINS = 0.25  # share of the cases that are tried in other units too
_STRATEGY = (
    "is not stable",
    "cannot be placed",
    "max_sensitivity",
    "cannot be reached",
    "poles are given",
    "use full_order or reduced_order",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One plant, its record and what is asked of it."""

    method: str
    plant: Plant
    recording: Recording
    options: Mapping[str, object]
    radius: float
    generator: np.random.Generator


def generator_of(kind: str, seed: int) -> np.random.Generator:
    """All that is random about one case."""
    return np.random.default_rng([seed, crc32(kind.encode())])


def draw_case(kind: str, seed: int) -> Case:
    """Plant, record and options of one case; kind is "method/strategy" or "delayed/goal"."""
    generator = generator_of(kind, seed)
    method, choice = kind.split("/")
    slow = choice in {"max_sensitivity", "bounded"}
    plant = draw_plant(generator, Limits(states=4 if slow else 12, radius=1.0 if choice == "bounded" else 1.2))
    n, m, m_d, _ = plant.sizes
    delay = int(generator.integers(0, 4)) if method == "delayed" else 1
    recording = draw_recording(generator, plant, Needs(columns=n + 2 * m + m_d))
    options: dict[str, object] = {"allow_blind": bool(generator.random() < 0.85)}
    radius = 1.0
    if method == "delayed":
        options |= {"delay": delay, "goal": choice}
    else:
        options["strategy"] = choice
        radius = _decay(generator, choice, options)
    _what_is_known(generator, plant, recording, options)
    return Case(method=method, plant=plant, recording=recording, options=options, radius=radius, generator=generator)


def _decay(generator: np.random.Generator, strategy: str, options: dict[str, object]) -> float:
    """Ask for a decay, or not; return the circle in which the fixed modes must lie."""
    default = {"dual_lqr": 0.5, "pole_placement": 0.5}.get(strategy, 1.0)
    if strategy == "minimum_norm" or generator.random() < 0.3:
        return default
    decay = 0.99999 if generator.random() < 0.6 else round(float(generator.uniform(0.2, 0.98)), 3)
    if strategy == "max_sensitivity":
        decay = min(decay, 0.97)
    options["decay"] = decay
    return decay if strategy in {"dual_lqr", "pole_placement"} else 1.0


def _what_is_known(
    generator: np.random.Generator, plant: Plant, recording: Recording, options: dict[str, object]
) -> None:
    """Sometimes the number of unknown inputs or the noise is given, and right."""
    E, _, T = effective(plant)
    if generator.random() < 0.3 and rank_of(E) == len(T):
        options["unknown_inputs"] = len(T)
    if recording.quality in {"noise", "single"} and len(plant.A) > LARGE:
        options["method"] = "total_least_squares"  # the likelihood of a large plant takes minutes
    if recording.quality == "noise" and generator.random() < 0.5:
        options["noise_std"] = tuple((recording.error * recording.units.x).tolist())


def truth_of(case: Case) -> tuple[Truth, Evidence]:
    """What is possible."""
    data = evidence(case.plant, case.recording)
    if "unknown_inputs" not in case.options:
        data = unless_like_noise(case.plant, case.recording, data)
    goal = case.options.get("goal")
    delay = case.options.get("delay", 1)
    assert isinstance(delay, int)
    exact = observer_truth(case.plant, data, delay=delay, radius=case.radius)
    if goal in {None, "exact"} or (goal == "best" and exact.answer is Answer.YES):
        return exact, data
    return observer_truth(case.plant, data, delay=delay, radius=1.0, decouple=False), data


def unless_like_noise(plant: Plant, recording: Recording, data: Evidence) -> Evidence:
    """As many unknown inputs as states move everything, as noise does: only who is told their number can know."""
    everything = np.linalg.matrix_rank(effective(plant)[0], tol=1e-9) == len(plant.A)
    hidden = everything or recording.quality in {"single", "noise"}
    return replace(data, error=max(data.error, UNCLEAR)) if hidden else data


def try_observer(kind: str, seed: int) -> Result:
    """Design, run on fresh data, judge; sometimes once more in other units."""
    case = draw_case(kind, seed)
    made = design(case.method, case.recording.history, case.options)
    truth, _ = truth_of(case)
    outcome, detail = judge_design(case, made, truth)
    guarantee = made.certificate.guarantee
    exact = guarantee is None or guarantee.exact  # a bound holds for |H e|, and H is given in the user's units
    if exact and outcome in {Outcome.RIGHT, Outcome.AGREED, Outcome.MISSED} and truth.answer is not Answer.OPEN:
        changed = _in_other_units(case, made) if case.generator.random() < _TWINS else None
        if changed is not None:
            outcome, detail = Outcome.UNITS, f"{changed} | {truth.why}"
    return Result(kind=kind, seed=seed, outcome=outcome, detail=f"{sizes_in_words(case)}: {detail}")


def sizes_in_words(case: Case) -> str:
    """The case in a few words."""
    n, m, m_d, p = case.plant.sizes
    through = "".join(name for name in "DG" if np.any(getattr(case.plant, name)))
    told = {key: value if key != "noise_std" else "right" for key, value in case.options.items()}
    return f"n={n} m={m} m_d={m_d} p={p} {through} {case.recording.in_words} {told}"


def judge_design(case: Case, made: Design, truth: Truth) -> tuple[Outcome, str]:
    """Judge what came out."""
    if made.observer is None:
        outcome, detail = refusal(truth, made.verdict)
        if outcome in {Outcome.MISSED, Outcome.UNSAID} and any(word in made.verdict for word in _STRATEGY):
            outcome = Outcome.STRATEGY
        if outcome in {Outcome.MISSED, Outcome.UNSAID} and "blind" in made.verdict and is_blind(case.plant):
            outcome = Outcome.AGREED
        return outcome, detail
    guarantee = made.certificate.guarantee
    if guarantee is not None and not guarantee.exact:
        return bounded_outcome(case.plant, case.recording, made, case.generator)
    like, full = (_fresh_misfit(case, made, full=full) for full in (False, True))
    exact = case.recording.quality not in {"noise", "single"}
    stated = stated_error(made.certificate)
    return acceptance(truth, made.verdict, like, full, exact=exact, stated=stated, decay=case.radius)


def is_blind(plant: Plant) -> bool:
    """As many unknown inputs as independent outputs explain everything."""
    E, G, _ = effective(plant)
    n, q = E.shape
    if q >= np.linalg.matrix_rank(np.hstack([plant.C, G])):
        return True
    z = 1.7 * np.exp(0.9j)
    gain = G + plant.C @ np.linalg.solve(z * np.eye(n) - plant.A, E.astype(complex))
    return int(np.linalg.matrix_rank(gain)) >= len(plant.C)


def _fresh_misfit(case: Case, made: Design, *, full: bool) -> Misfit:
    observer = made.observer
    assert observer is not None
    inner, delay = linear_of(observer), case.options.get("delay", 1)
    assert isinstance(delay, int)
    skipped = delay + 1
    steps = steps_for(inner, observer.states + observer.outputs, skipped)
    run = fresh_run(case.plant, case.recording, case.generator, steps, full=full)
    estimate, residual = run_observer(observer, case.recording, run)
    lag = observer.lag
    error = np.full_like(estimate, np.nan)
    error[lag:] = estimate[lag:] - run.x[: len(run.x) - lag]
    units = case.recording.units
    size = max(float(np.max(np.abs(run.x))), float(np.max(np.abs(run.y))), 1e-300)
    scales = np.full(len(units.x), size) * units.x, np.full(len(units.y), size) * units.y
    return misfit(inner, error * units.x, residual * units.y, max(skipped, lag), scales)


def run_observer(observer: Observer, recording: Recording, run: Run) -> tuple[Floats, Floats]:
    """Estimates and residuals of a fresh run, all in natural units."""
    m, units = run.u.shape[1], recording.units
    rows = np.hstack([run.u * units.u, run.y * units.y]) if m else run.y * units.y
    first = rows[0].tolist()

    def step(state: object, row: list[float]) -> tuple[object, list[object]]:
        following, output = observer.step(state, row[:m], row[m:])  # type: ignore[arg-type]
        return following, [*output.estimate, *output.residual]

    found = outputs_of(step, observer.init(first[:m], first[m:]), rows)  # type: ignore[arg-type]
    return found[:, : observer.states] / units.x[: observer.states], found[:, observer.states :] / units.y


def _in_other_units(case: Case, made: Design) -> str | None:
    """Design again in other units and compare."""
    twin = twin_of(case.generator, case.recording)
    options = dict(case.options)
    if "noise_std" in options:
        options["noise_std"] = tuple((twin.recording.error * twin.recording.units.x).tolist())
    again = design(case.method, twin.recording.history, options)

    def outputs() -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]] | None:
        return _both(case, made, again, twin)

    proof = made.certificate.proof
    return depends(twin, (made.verdict, again.verdict), outputs, proof.hardly if proof else 0.0)


def _both(
    case: Case, made: Design, again: Design, twin: Twin
) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]] | None:
    """What both observers say to the same run; None when only one was accepted."""
    one, two = made.observer, again.observer
    if one is None and two is None:
        nothing = np.zeros((0, len(case.recording.units.y)))
        return (nothing, nothing), (nothing, nothing)
    if one is None or two is None:
        return None
    run = fresh_run(case.plant, case.recording, case.generator, 20, full=False)
    return run_observer(one, case.recording, run), run_observer(two, twin.recording, twin.run(run))
