"""DGUs and lines of a generated grid."""

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from dgu_sim.explain import explain
from dgu_sim.grid_settings import CsvGrid, GridSettings, MeshGrid, RandomGeometricGrid, RingGrid, StarGrid
from dgu_sim.linear import FloatArray
from dgu_sim.loads import ConstantLoad, Load, TableLoad
from dgu_sim.model import finding
from dgu_sim.settings import DguSettings, LineSettings
from dgu_sim.signals import RandomSource, Stream

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["generated"]

Pairs: TypeAlias = NDArray[np.int64]
"""Positions of the DGUs at both ends of each line, shape (lines, 2)."""

_DRAWN = ("resistance_ohm", "inductance_h", "capacitance_f", "k1", "k2", "k3", "reference_v", "rated_current_a")
_BLOCKS = (*_DRAWN, "load", "line_resistance_ohm", "place")
"""Each is drawn from a block of its own: one more spread changes none of the others."""


def generated(grid: GridSettings) -> tuple[tuple[DguSettings, ...], tuple[LineSettings, ...]]:
    """Return DGUs and lines of a grid, a pure function of its settings.

    Every drawn value is U(1 - s, 1 + s) times that of the template or table. The gains are drawn as what the gain
    condition is about, so it holds for every DGU: 1 - k1 > 0, R_t - k2 > 0 and 0 < k3 / limit < 1.

    Raises:
        PydanticCustomError: A table holds what no DGU or line can have.
    """
    numbers, pairs = _layout(grid)
    values = _parameters(grid, len(numbers))
    loads = _loads(grid, len(numbers))
    names = tuple(values)
    dgus = []
    for row, (number, load, *own) in enumerate(
        zip(numbers, loads, *(one.tolist() for one in values.values()), strict=True)
    ):
        try:
            dgus.append(DguSettings(id=number, load=load, **dict(zip(names, own, strict=True))))
        except ValidationError as error:
            problem = explain(error, {})
            found = values[str(problem.key[0])][row] if problem.key[0] in values else problem.found
            raise finding(("dgus", *problem.key, row), float(found or 0.0), problem.expected) from None
    return tuple(dgus), _lines(grid, pairs, np.array(numbers))


def _layout(grid: GridSettings) -> tuple[list[int], Pairs]:
    """Return the numbers of the DGUs, and who is joined."""
    match grid:
        case CsvGrid():
            return _listed(grid)
        case MeshGrid():
            at = np.arange(grid.rows * grid.columns).reshape(grid.rows, grid.columns)
            joined = ((at[:, :-1], at[:, 1:]), (at[:-1], at[1:]))
            pairs = np.concatenate([np.stack([one.ravel(), two.ravel()], axis=1) for one, two in joined])
            size = at.size
        case RingGrid():
            size = grid.size
            ring = np.arange(size if size > 2 else 1)  # noqa: PLR2004 - two have one line
            pairs = np.stack([ring, (ring + 1) % size], axis=1)
        case StarGrid():
            size = grid.size
            pairs = np.stack([np.zeros(size - 1, dtype=np.int64), np.arange(1, size)], axis=1)
        case RandomGeometricGrid():
            size, pairs = grid.size, _near(grid)
    ordered = np.sort(pairs, axis=1)
    return list(range(1, size + 1)), ordered[np.lexsort((ordered[:, 1], ordered[:, 0]))]


def _listed(grid: CsvGrid) -> tuple[list[int], Pairs]:
    columns = grid.dgus.columns
    size = len(next(iter(columns.values())))
    numbers = list(range(1, size + 1)) if grid.dgus.id is None else list(grid.dgus.id)
    position = {number: row for row, number in enumerate(numbers)}
    ends = (grid.lines.first, grid.lines.second)
    for name, end in zip(("first", "second"), ends, strict=True):
        for row, number in enumerate(end):
            if number not in position:
                raise finding(("lines", name, row), number, "expected the number of a DGU of the table")
    pairs = np.array([[position[number] for number in end] for end in ends], dtype=np.int64).T
    return numbers, pairs


def _near(grid: RandomGeometricGrid) -> Pairs:
    """Return pairs nearer than the radius within which `degree` others are expected, and a spanning tree."""
    from scipy.sparse import coo_array  # noqa: PLC0415 (takes its time)
    from scipy.sparse.csgraph import minimum_spanning_tree  # noqa: PLC0415 (idem)
    from scipy.spatial import Delaunay, cKDTree  # noqa: PLC0415 (idem)

    places = _source(grid).generator(_BLOCKS.index("place")).uniform(0.0, 1.0, (grid.size, 2))
    radius = np.sqrt(grid.degree / (np.pi * grid.size))
    near = cKDTree(places).query_pairs(radius, output_type="ndarray")
    if grid.size > 3:  # noqa: PLR2004 - a triangulation wants a triangle and one more
        corners = Delaunay(places).simplices
        sides = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    else:
        sides = np.stack(np.triu_indices(grid.size, 1), axis=1)
    sides = np.unique(np.sort(sides, axis=1), axis=0)
    lengths = np.sqrt(((places[sides[:, 0]] - places[sides[:, 1]]) ** 2).sum(axis=1))
    tree = minimum_spanning_tree(coo_array((lengths, sides.T), shape=(grid.size, grid.size)).tocsr()).tocoo()
    tree_pairs = np.stack([tree.row, tree.col], axis=1)
    found: Pairs = np.unique(np.sort(np.concatenate([near, tree_pairs]), axis=1), axis=0).astype(np.int64)
    return found


def _parameters(grid: GridSettings, size: int) -> dict[str, FloatArray]:
    """Return one value for each DGU of every parameter that is drawn or listed."""
    template, spread = grid.dgu, grid.spread
    listed: Mapping[str, object] = grid.dgus.columns if isinstance(grid, CsvGrid) else {}
    value = {
        name: np.array(listed[name] if name in listed else np.full(size, getattr(template, name)), dtype=np.float64)
        for name in _DRAWN
    }
    share = {name: getattr(spread, "gains" if name in {"k1", "k2", "k3"} else name) for name in _DRAWN}
    if any(share[name] for name in ("resistance_ohm", "inductance_h", "k1")):
        R, L, k1, k2, k3 = (value[name] for name in ("resistance_ohm", "inductance_h", "k1", "k2", "k3"))
        below_one, below_R, of_limit = 1.0 - k1, R - k2, k3 * L / ((k1 - 1.0) * (k2 - R))
        value["resistance_ohm"] = R = R * _factor(grid, "resistance_ohm", share["resistance_ohm"], size)
        value["inductance_h"] = L = L * _factor(grid, "inductance_h", share["inductance_h"], size)
        value["k1"] = k1 = 1.0 - below_one * _factor(grid, "k1", share["k1"], size)
        value["k2"] = k2 = R - below_R * _factor(grid, "k2", share["k2"], size)
        limit = (k1 - 1.0) * (k2 - R) / L
        value["k3"] = limit * of_limit * _factor(grid, "k3", share["k3"], size)
    for name in ("capacitance_f", "reference_v", "rated_current_a"):
        value[name] = value[name] * _factor(grid, name, share[name], size)
    return value


def _loads(grid: GridSettings, size: int) -> list[tuple[Load, ...]]:
    factors = _factor(grid, "load", grid.spread.load, size).tolist()
    loads = [
        grid.dgu.load if factor == 1.0 else tuple(_scaled(one, factor) for one in grid.dgu.load) for factor in factors
    ]
    if not isinstance(grid, CsvGrid) or grid.dgus.load_a is None:
        return loads
    own = [factor * current for factor, current in zip(factors, grid.dgus.load_a, strict=True)]
    return [(*load, ConstantLoad(kind="constant", current_a=one)) for load, one in zip(loads, own, strict=True)]


def _scaled(load: Load, factor: float) -> Load:
    """Return a load whose current is so many times as large."""
    keys = (
        ("scale", "offset_a")
        if isinstance(load, TableLoad)
        else [key for key in type(load).model_fields if key.endswith("_a")]
    )
    return load.model_copy(update={key: getattr(load, key) * factor for key in keys})


def _lines(grid: GridSettings, pairs: Pairs, numbers: NDArray[np.int64]) -> tuple[LineSettings, ...]:
    listed: Mapping[str, object] = grid.lines.columns if isinstance(grid, CsvGrid) else {}
    resistance, inductance = (
        np.array(listed[name] if name in listed else np.full(len(pairs), getattr(grid.line, name)), dtype=np.float64)
        for name in ("resistance_ohm", "inductance_h")
    )
    resistance = resistance * _factor(grid, "line_resistance_ohm", grid.spread.line_resistance_ohm, len(pairs))
    lines = []
    columns = (numbers[pairs].tolist(), resistance.tolist(), inductance.tolist())
    for row, (between, R_ij, L_ij) in enumerate(zip(*columns, strict=True)):
        try:
            lines.append(LineSettings(between=(between[0], between[1]), resistance_ohm=R_ij, inductance_h=L_ij))
        except ValidationError as error:
            problem = explain(error, {})
            raise finding(("lines", *problem.key, row), problem.found, problem.expected) from None
    return tuple(lines)


def _factor(grid: GridSettings, name: str, share: float, size: int) -> FloatArray:
    """Return U(1 - share, 1 + share) for each DGU or line."""
    if share == 0.0:
        return np.ones(size)
    drawn: FloatArray = _source(grid).generator(_BLOCKS.index(name)).uniform(-1.0, 1.0, size)
    return 1.0 + share * drawn


def _source(grid: GridSettings) -> RandomSource:
    return RandomSource(seed=grid.seed, stream=Stream.GRID, dgu=0)
