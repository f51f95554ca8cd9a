"""Falsified outputs as inputs to be reconstructed: a record widened by an attack of our own making."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import MonitorError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor.history import History


def with_attack(history: History, outputs: Sequence[int], *, spread: float, seed: int) -> History:
    """Add random falsifications to some outputs of a record and append them to its inputs.

    An additive attack acts on y alone, so what it does to the record is known without any model: u becomes [u; phi],
    y becomes y + phi. An estimator designed from it reconstructs the attack vector, in the units of y, next to the
    inputs; that it exists (condition (8), zeros) is told from the record like for any other input.

    Args:
        history: the record, u being the inputs that will be unknown online.
        outputs: positions in y that may be falsified.
        spread: the falsifications are U(-spread, spread) [units of y]; as large as y moves is well conditioned.
        seed: of the falsifications.

    Raises:
        MonitorError: a position that y does not have.
    """
    if not all(0 <= output < history.outputs for output in outputs):
        raise MonitorError(f"outputs are {tuple(outputs)}, expected positions 0 to {history.outputs - 1}")
    experiments = []
    for number, experiment in enumerate(history.experiments):
        drawn = np.random.default_rng((seed, number)).uniform(-spread, spread, (len(experiment.y), len(outputs)))
        y = experiment.y.copy()
        y[:, list(outputs)] += drawn
        experiments.append(replace(experiment, u=np.hstack([experiment.u, drawn]), y=y))
    return replace(history, experiments=tuple(experiments))
