"""Topology: which DGUs are joined by lines, and the directed communication links along them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dgu_sim.errors import AttackError
from dgu_sim.linear import FloatArray
from dgu_sim.parameters import DguParameters

__all__ = ["Grid", "Line", "Link", "links_of"]


@dataclass(frozen=True, slots=True)
class Link:
    """A directed communication link: `target` receives the output of `source`. Prints as "1-2"."""

    source: int
    target: int

    def __str__(self) -> str:
        """Return the name used in scenarios and on the command line."""
        return f"{self.source}-{self.target}"

    @classmethod
    def parse(cls, text: str) -> "Link":
        """Read "1-2".

        Raises:
            AttackError: The text is not two DGU numbers joined by a dash.
        """
        source, dash, target = text.strip().partition("-")
        if not (dash and source.isdecimal() and target.isdecimal()):
            raise AttackError(f"link {text!r}: expected SOURCE-TARGET as two DGU numbers, like 1-2")
        return cls(int(source), int(target))


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A power line between two DGUs, quasi-stationary: I_ij = (V_i - V_j) / R_ij.

    Attributes:
        between: The two DGU numbers.
        resistance_ohm: R_ij [ohm].
    """

    between: tuple[int, int]
    resistance_ohm: float


@dataclass(frozen=True, kw_only=True)
class Grid:
    """DGUs and the lines between them.

    Attributes:
        dgus: DGU numbers, ascending: the order of every array axis "DGUs".
        parameters: Parameters of each DGU by number.
        lines: The lines, at most one between two DGUs.
    """

    dgus: tuple[int, ...]
    parameters: Mapping[int, DguParameters]
    lines: tuple[Line, ...]

    def conductances(self, dgu: int) -> dict[int, float]:
        """Return 1/R_ij [S] of the lines at one DGU, by the number of the other DGU, ascending."""
        return dict(self._adjacent[dgu])

    def neighbours(self, dgu: int) -> tuple[int, ...]:
        """Return the numbers of the DGUs that share a line with one DGU, ascending."""
        return tuple(self._adjacent[dgu])

    def component(self, dgu: int) -> tuple[int, ...]:
        """Return the numbers of all DGUs connected to one DGU by any path, itself included, ascending."""
        found, frontier = {dgu}, [dgu]
        while frontier:
            for other in self._adjacent[frontier.pop()]:
                if other not in found:
                    found.add(other)
                    frontier.append(other)
        return tuple(sorted(found))

    def components(self) -> tuple[tuple[int, ...], ...]:
        """Return the connected parts of the grid."""
        parts, left = [], set(self.dgus)
        for dgu in self.dgus:
            if dgu in left:
                parts.append(self.component(dgu))
                left.difference_update(parts[-1])
        return tuple(sorted(parts))

    @cached_property
    def _adjacent(self) -> Mapping[int, Mapping[int, float]]:
        """1/R_ij [S] of the lines at each DGU, by the number of the other one, both ascending."""
        found: dict[int, dict[int, float]] = {dgu: {} for dgu in self.dgus}
        for line in self.lines:
            first, second = line.between
            found[first][second] = found[second][first] = 1.0 / line.resistance_ohm
        return {dgu: dict(sorted(others.items())) for dgu, others in found.items()}

    def laplacian(self) -> FloatArray:
        """Return the unweighted graph Laplacian, shape (DGUs, DGUs)."""
        position = {dgu: index for index, dgu in enumerate(self.dgus)}
        L = np.zeros((len(self.dgus), len(self.dgus)))
        for line in self.lines:
            i, j = (position[dgu] for dgu in line.between)
            L[i, i] += 1.0
            L[j, j] += 1.0
            L[i, j] -= 1.0
            L[j, i] -= 1.0
        return L


def links_of(pairs: Sequence[tuple[int, int]]) -> tuple[Link, ...]:
    """Return both directed links of each line in the order of every array axis "links": by target, then source."""
    both = [Link(a, b) for a, b in pairs] + [Link(b, a) for a, b in pairs]
    return tuple(sorted(both, key=lambda link: (link.target, link.source)))
