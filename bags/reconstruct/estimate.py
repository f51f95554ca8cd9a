"""Inputs and attacks on one link of a recorded run, reconstructed from what was received and the offline history."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bags.mcap.errors import BagError
from bags.reconstruct.reconstruction import Reconstruction
from bags.runs.reader import open_run
from bags.runs.run_record import RunRecord
from bags.wire.convert import history_of
from bags.wire.origin import SCENARIO_ATTACHMENT
from dgu_sim.grid import Link
from dgu_sim.plant import Coupling
from dgu_sim.scenario import Scenario, parse_scenario
from monitor import input_estimators
from monitor.attack_size import (
    Hypothesis,
    Spans,
    Vector,
    noise_response,
    reconstruct,
    under_hypothesis,
    with_calm_inputs,
)
from monitor.errors import HistoryError
from monitor.history import History, sent_outputs

_SETTLE_SEC = 0.5
_GUARD_SEC = 0.05  # the alarm may come a few samples after the attack
_VECTOR_SEC = 0.1  # for so long loads and references are taken to stay
_SIGMAS = 2.0


def reconstruct_link(
    path: Path,
    link: Link,
    *,
    estimator: str = "delayed",
    options: Mapping[str, object] | None = None,
    window_sec: tuple[float | None, float | None] = (None, None),
    noise_std: tuple[float, float, float] | None = None,
) -> Reconstruction:
    """Reconstruct what acted on a DGU and what was falsified on a link.

    Args:
        path: Bag of a run.
        link: The link.
        estimator: Name of the input estimator.
        options: Its options.
        window_sec: Start and end of the attack to measure [s]; None: first alarm of the link's monitor, and last.
        noise_std: Noise on (V, I_t, v) [V, A, V s]; None: equal on all, as the calm attack estimates spread.

    Raises:
        BagError: The bag cannot be read, or holds neither this link nor its history.
        monitor.errors.MonitorError: Unknown estimator or option.
    """
    run = open_run(path)
    if link not in run.topics.links:
        raise BagError(f"{path}: no link {link}, expected one of {', '.join(map(str, run.topics.links))}")
    experiments = [one for one in run.histories if one.dgu == link.source]
    if not experiments:
        raise BagError(f"{path}: holds no history of DGU {link.source}")
    sent, channels = sent_outputs(history_of(experiments))
    data = _gathered(list(run.windows()), link, _scenario_of(run.attachments, path))
    received = data.received[:, channels]
    period_sec = run.topics.sampling_period_ns * 1e-9
    spans = _spans(data.alarm, window_sec, period_sec)
    made = input_estimators.design(estimator, sent, options or {})
    count = max(sent.experiments[0].d.shape[1], 1)
    inputs = np.full((len(received), count), np.nan)
    if made.estimator is not None:
        inputs = reconstruct(made.estimator, received, data.delivered)
    hypotheses = tuple(
        under_hypothesis(sent, channel, received, data.delivered, spans) for channel in range(len(channels))
    )
    vector, reason = _vector(sent, inputs, received, spans, round(_VECTOR_SEC / period_sec))
    noise = np.full(3, _noise_std(hypotheses)) if noise_std is None else np.array(noise_std)
    uncertainty = np.full(count, np.nan)
    if made.estimator is not None:
        bound = np.asarray(made.numbers.get("input_bound", np.zeros(count)), dtype=np.float64)
        uncertainty = bound + _SIGMAS * np.linalg.norm(noise_response(made.estimator) * noise[list(channels)], axis=1)
    return Reconstruction(
        link=link,
        estimator=estimator,
        verdict=made.verdict,
        time_sec=np.arange(len(received), dtype=np.float64) * period_sec,
        inputs=inputs,
        applied=data.applied,
        input_uncertainty=uncertainty,
        noise_std=noise,
        spans=spans,
        hypotheses=hypotheses,
        vector=vector,
        vector_reason=reason,
        falsified=data.received - data.sent,
        channels=channels,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Gathered:
    """What is needed of the steps of a run."""

    received: NDArray[np.float64]
    delivered: NDArray[np.bool_]
    alarm: NDArray[np.bool_]
    sent: NDArray[np.float64]
    applied: NDArray[np.float64]


def _gathered(windows: list[RunRecord], link: Link, scenario: Scenario | None) -> _Gathered:
    position, source = windows[0].links.index(link), windows[0].topics.dgus.index(link.source)
    return _Gathered(
        received=np.concatenate([one.received[:, position] for one in windows]),
        delivered=np.concatenate([one.delivered[:, position] for one in windows]),
        alarm=np.concatenate([one.alarm[:, position] for one in windows]),
        sent=np.concatenate([one.y[:, source] for one in windows]),
        applied=np.concatenate([_applied(one, source, scenario) for one in windows]),
    )


def _applied(record: RunRecord, source: int, scenario: Scenario | None) -> NDArray[np.float64]:
    """(steps, 2) I_net + I_L and V_ref + alpha of a simulated DGU; between samples of a joint grid I_net moves on."""
    if scenario is None:
        return np.full((record.steps, 2), np.nan)
    current = record.load_current[:, source].copy()
    if scenario.coupling is not Coupling.ISOLATED:
        for other, conductance in scenario.grid.conductances(record.topics.dgus[source]).items():
            current = current - conductance * record.x[:, record.topics.dgus.index(other), 0]
    return np.column_stack([current, record.reference[:, source]])


def _scenario_of(attachments: Mapping[str, bytes], path: Path) -> Scenario | None:
    text = attachments.get(SCENARIO_ATTACHMENT)
    return None if text is None else parse_scenario(text.decode(), source=f"{path}/{SCENARIO_ATTACHMENT}")


def _spans(alarm: NDArray[np.bool_], window_sec: tuple[float | None, float | None], period_sec: float) -> Spans:
    """Calm and attacked steps; without an alarm and a start of one's own nothing is attacked."""
    steps, raised = len(alarm), np.flatnonzero(alarm)
    first = int(raised[0]) if raised.size else steps
    last = int(raised[-1]) + 1 if raised.size else steps
    start = first if window_sec[0] is None else min(max(round(window_sec[0] / period_sec), 0), steps)
    stop = max(last, start) if window_sec[1] is None else min(round(window_sec[1] / period_sec), steps)
    if window_sec[0] is not None and window_sec[1] is None and stop <= start:
        stop = steps
    guard = 0 if start == steps else round(_GUARD_SEC / period_sec)
    settled = min(round(_SETTLE_SEC / period_sec), steps)
    return Spans(calm=(settled, max(start - guard, settled)), attack=(start, max(stop, start)))


def _vector(
    history: History, inputs: NDArray[np.float64], received: NDArray[np.float64], spans: Spans, samples: int
) -> tuple[Vector | None, str]:
    if spans.attack[0] == spans.attack[1]:
        return None, "no alarm on this link, and no start given"
    try:
        return with_calm_inputs(history, inputs, received, spans, samples), ""
    except HistoryError as error:
        return None, str(error)


def _noise_std(hypotheses: tuple[Hypothesis, ...]) -> float:
    """The noise level at which the calm attack estimates spread as they do, median over the outputs."""
    levels = [one.uncertainty / (_SIGMAS * one.noise_gain) for one in hypotheses if one.noise_gain > 0.0]
    known = [level for level in levels if isfinite(level)]
    return float(np.median(known)) if known else float("nan")
