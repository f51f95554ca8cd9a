"""Averaging over repeated experiments: the same start and the same inputs, known and unknown, several times."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monitor.errors import HistoryError
from monitor.history import Experiment, History


def averaged(history: History) -> History:
    """Replace repetitions of one experiment by their mean; noise falls with the root of their number.

    A sample missing in one repetition is missing in the mean.

    Raises:
        HistoryError: the experiments differ in length, so they are no repetitions.
    """
    lengths = sorted({len(experiment.x) for experiment in history.experiments})
    if len(lengths) != 1:
        raise HistoryError(f"repeated experiments have {lengths} samples, expected the same number in each")
    u, y, x = (np.mean([getattr(one, name) for one in history.experiments], axis=0) for name in ("u", "y", "x"))
    return replace(history, experiments=(Experiment(u, y, x),))
