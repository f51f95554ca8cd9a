"""Where DGUs are drawn: few on a circle, many so that those with a line between them are near each other."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import shortest_path

_ON_A_CIRCLE = 16


def places(dgus: Sequence[int], lines: Sequence[tuple[int, int]]) -> list[tuple[float, float]]:
    """Coordinates from 0 to 1 of each DGU.

    Many DGUs are placed by classical scaling of the number of lines between them: X = the two leading eigenvectors of
    -J D^2 J / 2, D the distances, J the centring matrix (Torgerson 1952).

    Args:
        dgus: Numbers of the DGUs.
        lines: Pairs of them.
    """
    count = len(dgus)
    if count <= _ON_A_CIRCLE or not lines:
        angles = -np.pi / 2 + 2 * np.pi * np.arange(count) / max(count, 1)
        reach = 0.5 if count > 1 else 0.0
        return [(0.5 + reach * float(np.cos(one)), 0.5 + reach * float(np.sin(one))) for one in angles]
    at = {dgu: place for place, dgu in enumerate(dgus)}
    ends = np.array([(at[one], at[other]) for one, other in lines]).T
    distance = shortest_path(
        coo_array((np.ones(len(lines)), ends), shape=(count, count)), directed=False, unweighted=True
    )
    distance[np.isinf(distance)] = distance[np.isfinite(distance)].max() + 2  # parts without a line between them
    squares = distance**2
    centred = squares - squares.mean(axis=0) - squares.mean(axis=1)[:, None] + squares.mean()
    values, vectors = np.linalg.eigh(-centred / 2)
    spots = vectors[:, -2:][:, ::-1] * np.sqrt(np.maximum(values[-2:][::-1], 0.0))
    spots -= spots.min(axis=0)
    spots = spots / max(float(spots.max()), 1e-9)
    spots += (1 - spots.max(axis=0)) / 2
    return [(float(x), float(y)) for x, y in spots]
