"""Which link is accused while which one is attacked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.measures.intervals import Measured, clopper_pearson

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Confusion:
    """Confusion of links.

    Attributes:
        samples: (links + 1, links + 1) samples in which the row's link was attacked and the column's link accused, off
            the diagonal only where that one was not attacked too; the last row counts samples without any attack, the
            last column samples without any accusation.
        attacked_samples: (links + 1,) samples of each row: more than one link may be accused at once.
        first_right: sets of simultaneous attacks whose first accusation anywhere hit a link that was attacked then, of
            those with an accusation.
        exact: sets of simultaneous attacks during which exactly the attacked links were accused, of all.
    """

    samples: NDArray[np.int64]
    attacked_samples: NDArray[np.int64]
    first_right: Measured
    exact: Measured


def isolation(
    alarm: NDArray[np.bool_],
    attacked: NDArray[np.bool_],
    judged: NDArray[np.bool_],
    attacks: Sequence[tuple[int, int]],
    level: float = 0.95,
) -> Confusion:
    """Count accusations by what was attacked; attacks that overlap in time are judged as one set.

    Args:
        alarm: (steps, links).
        attacked: (steps, links).
        judged: (steps, links) samples that count: armed, and not just after an attack on that link.
        attacks: steps [start, stop) of each attack.
        level: confidence.
    """
    rows = judged.all(axis=1)
    truth = np.column_stack([attacked, ~attacked.any(axis=1)])[rows]
    accused = np.column_stack([alarm, ~alarm.any(axis=1)])[rows]
    wrong, right = accused & ~truth, accused & truth  # a link that is attacked too is accused rightly
    wrong[:, -1] = accused[:, -1]
    samples = truth.T.astype(np.int64) @ wrong.astype(np.int64)
    samples[np.diag_indices(len(samples) - 1)] = right[:, :-1].sum(axis=0)
    alarm = alarm & judged
    sets = simultaneous(attacks)
    first_right, first_made, exact = 0, 0, 0
    for start, stop in sets:
        during, under = alarm[start:stop], attacked[start:stop]
        exact += np.array_equal(during.any(axis=0), under.any(axis=0))
        if during.any():
            first = np.flatnonzero(during.any(axis=1))[0]
            first_made += 1
            first_right += bool((during[first] & under[first]).any())
    return Confusion(
        samples=samples,
        attacked_samples=truth.sum(axis=0, dtype=np.int64),
        first_right=clopper_pearson(first_right, first_made, level),
        exact=clopper_pearson(exact, len(sets), level),
    )


def simultaneous(attacks: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Steps [start, stop) of each set of attacks that overlap in time, by start."""
    found: list[tuple[int, int]] = []
    for start, stop in sorted(attacks):
        if found and start < found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], stop))
        else:
            found.append((start, stop))
    return found
