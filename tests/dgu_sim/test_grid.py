"""Topology."""

import numpy as np
import pytest

from dgu_sim.errors import AttackError
from dgu_sim.grid import Grid, Line, Link, links_of
from dgu_sim.parameters import DguParameters

PARAMETERS = DguParameters(R_t=0.2, L_t=1.8e-3, C_t=2.2e-3, k1=-2.134, k2=-0.163, k3=13.553)


def _grid(dgus: tuple[int, ...], *pairs: tuple[int, int]) -> Grid:
    lines = tuple(Line(between=pair, resistance_ohm=0.05) for pair in pairs)
    return Grid(dgus=dgus, parameters=dict.fromkeys(dgus, PARAMETERS), lines=lines)


def test_links_are_ordered_by_target_then_source() -> None:
    """Every line carries two links, and their order is the one of the array axes."""
    names = [str(link) for link in links_of([(3, 1), (1, 2), (2, 3)])]
    assert names == ["2-1", "3-1", "1-2", "3-2", "1-3", "2-3"]


def test_link_text_round_trips() -> None:
    """A link prints as it is read."""
    assert str(Link.parse("12-3")) == "12-3"
    assert Link.parse(" 1-2 ") == Link(1, 2)


@pytest.mark.parametrize("text", ["", "1", "1-", "-2", "a-b", "1-2-3", "1.0-2"])
def test_wrong_link_text_is_refused(text: str) -> None:
    """What is no pair of DGU numbers is named, with an example of what is."""
    with pytest.raises(AttackError, match="expected SOURCE-TARGET"):
        Link.parse(text)


def test_neighbours_conductances_and_components() -> None:
    """Lines join DGUs whatever the order they are written in; paths join components."""
    grid = _grid((1, 2, 5, 7, 9), (5, 1), (1, 2), (9, 7))
    assert grid.neighbours(1) == (2, 5)
    assert grid.conductances(5) == {1: 20.0}
    assert grid.component(2) == (1, 2, 5)
    assert grid.components() == ((1, 2, 5), (7, 9))


def test_laplacian_has_zero_sums_and_one_zero_eigenvalue_a_component() -> None:
    """The Laplacian is symmetric with zero row sums; its kernel counts the components."""
    grid = _grid((1, 2, 5, 7, 9), (5, 1), (1, 2), (9, 7))
    L = grid.laplacian()
    assert np.array_equal(L, L.T)
    assert np.array_equal(L.sum(axis=1), np.zeros(5))
    assert np.linalg.matrix_rank(L) == len(grid.dgus) - len(grid.components())
