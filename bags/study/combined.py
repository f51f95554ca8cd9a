"""Monitors that draw one conclusion from several tests, in a study: runs that differ in the attack side by side."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bags.study.judging import Concluded
from bags.watch.designs import RunDesigns
from bags.watch.watcher import Watcher
from monitor.combined import DguOutput
from monitor.detectors import Phase


class Signals(NamedTuple):
    """What happened in several runs.

    Attributes:
        sent: y, shape (steps, runs, DGUs, 3).
        reference: V_ref + alpha, shape (steps, runs, DGUs) [V].
        received: y^c, shape (steps, runs, links, 3).
        delivered: Shape (steps, runs, links).
        lying: Where somebody else speaks on a link, shape (steps, runs, links).
    """

    sent: NDArray[np.float64]
    reference: NDArray[np.float64]
    received: NDArray[np.float64]
    delivered: NDArray[np.bool_]
    lying: NDArray[np.bool_]


def conclude(designs: RunDesigns, signals: Signals) -> Concluded:
    """Watch runs whose monitors have the same designs.

    Args:
        designs: What the monitors run.
        signals: What happened.

    Returns:
        Shapes (steps, runs, links): an alarm where a link is accused or, with nobody accused, suspected; armed once
        what arms last is; sizes of the residuals of the links' observers.
    """
    shape = signals.delivered.shape
    phase, alarm, size = np.empty(shape, dtype=np.uint8), np.empty(shape, dtype=np.bool_), np.zeros(shape)
    watch = Watcher(designs=designs, runs=shape[1])
    y_c, y = np.moveaxis(signals.received, -1, 1), np.moveaxis(signals.sent, -1, 1)  # (steps, 3, runs, places)
    for k in range(len(y)):
        lying = signals.lying[k].T
        said = watch.step(
            y[k],
            signals.reference[k],
            y_c[k],
            signals.delivered[k],
            list(lying) if lying.any() else [False] * len(lying),
        )
        at = 0
        for output in said:
            at = _note((alarm, phase, size), k, at, output)
    return Concluded(alarm, phase == Phase.ARMED.value, size)


def _note(found: tuple[NDArray[Any], ...], k: int, first: int, said: DguOutput) -> int:
    """Write what one monitor said at step k into the arrays of all links, from its first one on; the next one's."""
    alarm, phase, size = (one[k] for one in found)
    others: list[Any] = [] if said.local is None else [said.local.monitor.phase]
    isolation = said.verdict.isolation
    for number, link in enumerate(said.links):
        at = first + number
        phases = [link.phase, *others, *([said.inputs[number].phase] if said.inputs else [])]
        phase[:, at] = np.min(np.broadcast_arrays(*phases), axis=0)
        alarm[:, at] = np.asarray(isolation.accused[number]) | np.asarray(isolation.suspected[number])
        for component in link.residual:
            np.maximum(size[:, at], np.nan_to_num(np.abs(component)), out=size[:, at])
    return first + len(said.links)
