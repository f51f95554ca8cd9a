"""Where DGUs are drawn."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from dcmg.page.placing import places


def test_few_stand_on_a_circle() -> None:
    """Six DGUs have the same distance from the middle, the first at the top."""
    found = np.array(places(range(1, 7), [(1, 2)]))
    np.testing.assert_allclose(np.hypot(*(found - 0.5).T), 0.5)
    np.testing.assert_allclose(found[0], [0.5, 0.0], atol=1e-12)


def test_many_stand_near_those_that_they_are_joined_to() -> None:
    """In a mesh of ten by ten every line is shorter than any pair that is five lines apart; islands are drawn, too."""
    mesh = [(10 * x + y, 10 * x + y + 1) for x in range(10) for y in range(9)]
    mesh += [(10 * x + y, 10 * x + 10 + y) for x in range(9) for y in range(10)]
    found = np.array(places(range(102), [*mesh, (100, 101)]))
    assert found.min() >= 0.0
    assert found.max() <= 1.0
    spots = np.array(places(range(100), mesh))
    joined = max(np.hypot(*(spots[one] - spots[other])) for one, other in mesh)
    apart = [
        np.hypot(*(spots[one] - spots[other]))
        for one, other in combinations(range(100), 2)
        if abs(one // 10 - other // 10) + abs(one % 10 - other % 10) > 4
    ]
    assert joined < min(apart)
