"""Monitors that draw one conclusion from several tests, in a study: runs that differ in the attack side by side."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bags.study.settings import StudyObserver
from bags.watch.combined import design_combined
from bags.watch.histories import histories_of_run
from bags.watch.monitors import MonitorArrays
from bags.wire.convert import history_of
from bags.wire.schema import RunTopics, parts_of, topics_of
from dgu_sim.scenario import Scenario
from dgu_sim.settings import DetectorSettings, MonitorSettings
from monitor.combined import CombinedDesign, DguOutput, Own, Received
from monitor.detectors import Phase

_WIDTH = 3


def combined_settings(observer: StudyObserver, kind: str, options: dict[str, object]) -> MonitorSettings:
    """Return the monitor section that an observer of a study stands for, with one detector."""
    return MonitorSettings.model_validate(
        {
            "observer": {"kind": observer.kind, "options": observer.options},
            "detector": DetectorSettings.model_validate({"kind": kind, "options": options}),
            "local": observer.local,
            "plausibility": observer.plausibility,
        }
    )


class Signals(NamedTuple):
    """What happened in several runs.

    Attributes:
        sent: y, shape (steps, runs, DGUs, 3).
        reference: V_ref + alpha, shape (steps, runs, DGUs) [V].
        received: y^c, shape (steps, runs, links, 3).
        delivered: Shape (steps, runs, links).
    """

    sent: NDArray[np.float64]
    reference: NDArray[np.float64]
    received: NDArray[np.float64]
    delivered: NDArray[np.bool_]


def conclude(scenario: Scenario, settings: MonitorSettings, signals: Signals) -> MonitorArrays:
    """Watch runs of one seed.

    Args:
        scenario: The scenario with that seed: the monitors learn from its histories.
        settings: What the monitors run.
        signals: What happened.

    Returns:
        Shape (steps, runs, links, ...): `alarm` where a link is accused or, with nobody accused, suspected; `phase` of
        what arms last; `residual` and `threshold` of the links' observers.
    """
    topics = replace(topics_of(scenario), parts=parts_of(settings))
    histories = {dgu: history_of(histories_of_run(scenario, dgu)) for dgu in topics.dgus}
    designs = design_combined(topics, settings, histories)
    delivered = signals.delivered
    found = MonitorArrays(
        phase=np.full(delivered.shape, Phase.REFUSED.value, dtype=np.uint8),
        alarm=np.zeros(delivered.shape, dtype=np.bool_),
        **{name: np.full((*delivered.shape, _WIDTH), np.nan) for name in ("estimate", "residual", "threshold")},
    )
    states = [one.monitor.init() for one in designs]
    y_c, y = np.moveaxis(signals.received, -1, 1), np.moveaxis(signals.sent, -1, 1)  # (steps, 3, runs, places)
    for k in range(len(delivered)):
        for number, (monitor, designed) in enumerate(zip(topics.monitors, designs, strict=True)):
            incoming, own = _places(topics, monitor)
            states[number], said = designed.monitor.step(
                states[number],
                [Received(tuple(y_c[k, :, :, at]), delivered[k, :, at]) for at in incoming],
                Own(tuple(y[k, :, :, own]), signals.reference[k, :, own]),
            )
            _note(found, k, incoming, designed, said)
    return found


def _places(topics: RunTopics, monitor: int) -> tuple[list[int], int]:
    """Return where a monitor's links and its own DGU are on their axes."""
    return [at for at, link in enumerate(topics.links) if link.target == monitor], topics.dgus.index(monitor)


def _note(found: MonitorArrays, k: int, incoming: Sequence[int], designed: CombinedDesign, said: DguOutput) -> None:
    """Write what one monitor said at step k into the arrays of all links."""
    others: list[Any] = [] if said.local is None else [said.local.monitor.phase]
    for number, at in enumerate(incoming):
        link = said.links[number]
        phases = [link.phase, *others, *([said.inputs[number].phase] if designed.monitor.inputs else [])]
        found.phase[k, :, at] = np.min(np.broadcast_arrays(*phases), axis=0)
        isolation = said.verdict.isolation
        found.alarm[k, :, at] = np.asarray(isolation.accused[number]) | np.asarray(isolation.suspected[number])
        for name in ("residual", "threshold"):
            for component, value in enumerate(getattr(link, name)):
                getattr(found, name)[k, :, at, component] = value
