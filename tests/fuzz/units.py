"""What must not matter: the units of u, y, x, d, and the order of the outputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.history import Experiment, History
from tests.fuzz.recordings import Recording, Units

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tests.fuzz.fresh import Run

    Floats = NDArray[np.float64]

_SAME = 1e-6  # of the largest signal: what the two observers may differ by
_REACH = 8.0  # decades


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin:
    """The same record in other units, its outputs in another order.

    Attributes:
        recording: with its own units.
        order: position in the original y of every output.
    """

    recording: Recording
    order: NDArray[np.int64]

    def run(self, run: Run) -> Run:
        """A fresh run as the twin sees it: natural units, outputs in its order."""
        return replace(run, y=run.y[:, self.order])


def twin_of(generator: np.random.Generator, recording: Recording) -> Twin:
    """Change all units by up to eight decades and shuffle the outputs."""
    units = recording.units
    u, y, x, d = (10.0 ** generator.uniform(-_REACH, _REACH, len(one)) for one in _four(units))
    factors = Units(u=u, y=y, x=x, d=d)
    order = generator.permutation(len(units.y))
    experiments = tuple(
        Experiment(one.u * factors.u, (one.y * factors.y)[:, order], one.x * factors.x, None, one.d * factors.d)
        for one in recording.history.experiments
    )
    joined = Units(u=units.u * factors.u, y=(units.y * factors.y)[order], x=units.x * factors.x, d=units.d * factors.d)
    history = History(experiments, recording.history.sampling_period_sec)
    return Twin(recording=replace(recording, history=history, units=joined), order=order)


def apart(one: tuple[Floats, Floats], two: tuple[Floats, Floats], twin: Twin) -> float:
    """Largest difference of estimates and residuals (natural units) of both, relative to the largest of them."""
    size = max(float(np.max(np.abs(mine), initial=1.0)) for mine in one)
    pairs = ((one[0], two[0]), (one[1][:, twin.order], two[1]))
    worst = max(float(np.max(np.abs(mine - theirs), initial=0.0)) for mine, theirs in pairs) / size
    return worst if np.isfinite(worst) else np.inf


def depends(
    twin: Twin,
    verdicts: tuple[str, str],
    outputs: Callable[[], tuple[tuple[Floats, Floats], tuple[Floats, Floats]] | None],
    doubt: float = 0.0,
) -> str | None:
    """Say how the answers differ, None when they do not; `outputs` runs both over the same fresh data.

    An answer that says that it is borderline may be another one, and outputs may differ by a doubt that is stated.
    """
    both = outputs()
    if both is None and all("borderline" in verdict for verdict in verdicts):
        return None
    if both is None:
        return f"in other units: {verdicts[1]} | here: {verdicts[0]}"
    difference = apart(*both, twin)
    return (
        f"outputs differ by {difference:.1e} in other units: {verdicts[0]}" if difference > max(_SAME, doubt) else None
    )


def _four(units: Units) -> tuple[Floats, Floats, Floats, Floats]:
    return units.u, units.y, units.x, units.d
