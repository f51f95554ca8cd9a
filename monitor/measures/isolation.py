"""Which link is accused while which one is attacked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.measures.intervals import Estimate, clopper_pearson

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.measures.episodes import Episode


@dataclass(frozen=True, slots=True, kw_only=True)
class Isolation:
    """Confusion of links.

    Attributes:
        samples: (links + 1, links + 1) samples in which the row's link was attacked and the column's link accused; the
            last row counts samples without any attack, the last column samples without any accusation.
        attacked_samples: (links + 1,) samples of each row: more than one link may be accused at once.
        first_right: attacks whose first accusation anywhere hit an attacked link, of those with an accusation.
        exact: attacks during which exactly the attacked links were accused, of all.
    """

    samples: NDArray[np.int64]
    attacked_samples: NDArray[np.int64]
    first_right: Estimate
    exact: Estimate


def isolation(
    alarm: NDArray[np.bool_],
    attacked: NDArray[np.bool_],
    judged: NDArray[np.bool_],
    attacks: Sequence[tuple[Sequence[int], Episode]],
    level: float = 0.95,
) -> Isolation:
    """Count accusations by what was attacked.

    Args:
        alarm: (steps, links).
        attacked: (steps, links).
        judged: (steps,) samples that count: armed, and not just after an attack.
        attacks: positions of the links of each attack, and when it ran.
        level: confidence.
    """
    truth = np.column_stack([attacked, ~attacked.any(axis=1)])[judged]
    accused = np.column_stack([alarm, ~alarm.any(axis=1)])[judged]
    first_right, first_made, exact = 0, 0, 0
    for positions, one in attacks:
        during = alarm[one.start_step : one.stop_step]
        ever = set(np.flatnonzero(during.any(axis=0)).tolist())
        exact += ever == set(positions)
        if ever:
            first = during[np.flatnonzero(during.any(axis=1))[0]]
            first_made += 1
            first_right += bool(set(np.flatnonzero(first).tolist()) & set(positions))
    return Isolation(
        samples=truth.T.astype(np.int64) @ accused.astype(np.int64),
        attacked_samples=truth.sum(axis=0, dtype=np.int64),
        first_right=clopper_pearson(first_right, first_made, level),
        exact=clopper_pearson(exact, len(attacks), level),
    )
