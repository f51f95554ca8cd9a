"""Plants that several nodes watch, and their records: x+ (or x') = A x + B u, node i measures C_i x, is told some u."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.distributed import Regressors, derivatives, sampled
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.distributed import NodeGains

    Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """A (n, n), B (n, m), for each node C (p, n) and the columns of u that it is told."""

    A: Floats
    B: Floats
    C: tuple[Floats, ...]
    known: tuple[list[int], ...]

    def unknown(self, node: int) -> Floats:
        """Bbar of a node: columns of the inputs that it is not told."""
        return self.B[:, [one for one in range(self.B.shape[1]) if one not in self.known[node]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class GridUnits:
    """What one natural unit of x, u and the outputs of each node is in the record."""

    x: Floats
    u: Floats
    y: tuple[Floats, ...]

    @property
    def in_words(self) -> str:
        """Smallest and largest, nothing for natural ones."""
        every = np.concatenate([self.x, self.u, *self.y])
        return f" units {every.min():.0e} to {every.max():.0e}" if np.any(every != 1.0) else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """A record of a grid, one row an instant.

    Attributes:
        x: (N, n) states; `x_next` their next values or derivatives.
        u: (N, m).
        y: of each node; `y_next` likewise.
        units: of all of them.
        error: relative, of every number.
        quality: in one word.
        condition: largest over smallest singular value of the true [x u].
    """

    x: Floats
    x_next: Floats
    u: Floats
    y: tuple[Floats, ...]
    y_next: tuple[Floats, ...]
    units: GridUnits
    error: float
    quality: str
    condition: float

    def regressors(self, grid: Grid, node: int, *, discrete: bool) -> Regressors:
        """What a node has of it."""
        u, y, y_next = self.u[:, grid.known[node]], self.y[node], self.y_next[node]
        if not discrete:
            return derivatives(u, y, self.x, y_next, self.x_next)
        pairs = tuple(
            Experiment(np.stack([u[k], u[k]]), np.stack([y[k], y_next[k]]), np.stack([self.x[k], self.x_next[k]]))
            for k in range(len(y))
        )
        return sampled(History(pairs, 0.1))


def draw_grid(generator: np.random.Generator, *, discrete: bool) -> Grid:
    """A random grid of two to four nodes."""
    n, m, nodes = (int(generator.integers(low, high)) for low, high in ((2, 7), (1, 4), (2, 5)))
    A = generator.standard_normal((n, n))
    A *= generator.uniform(0.3, 1.1) / max(float(np.max(np.abs(np.linalg.eigvals(A)))), 1e-3)
    if not discrete:
        A -= float(generator.uniform(-0.2, 1.0)) * np.eye(n)
    C, known = [], []
    for _ in range(nodes):
        told = [one for one in range(m) if generator.random() < 0.6]
        p = int(generator.integers(min(max(1, m - len(told)), n), n + 1))
        rows = np.eye(n)[generator.permutation(n)[:p]]
        C.append(rows if generator.random() < 0.6 else generator.standard_normal((p, n)))
        known.append(told)
    return Grid(A=A, B=generator.standard_normal((n, m)), C=tuple(C), known=tuple(known))


def draw_log(generator: np.random.Generator, grid: Grid) -> Log:
    """A record of independent instants."""
    n, m = grid.B.shape
    columns = 3 * (n + m) + 20 if generator.random() < 0.8 else int(generator.integers(3, n + m + 6))
    quality = str(generator.choice(["exact", "single", "noise"], p=(0.75, 0.1, 0.15)))
    error = {"single": 6e-8, "noise": 10.0 ** float(generator.uniform(-7.0, -2.0))}.get(quality, 2.3e-16)
    natural = generator.random() < 0.5
    widths = [n, m, *(len(C) for C in grid.C)]
    drawn = [np.ones(one) if natural else 10.0 ** generator.uniform(-6.0, 6.0, one) for one in widths]
    units = GridUnits(x=drawn[0], u=drawn[1], y=tuple(drawn[2:]))
    x, u = generator.uniform(-1.0, 1.0, (columns, n)), generator.uniform(-1.0, 1.0, (columns, m))
    x_next = x @ grid.A.T + u @ grid.B.T
    values = np.linalg.svd(np.hstack([x, u]), compute_uv=False)

    def recorded(signal: Floats, unit: Floats) -> Floats:
        if quality == "noise":
            signal = signal + error * generator.standard_normal(signal.shape)
        signal = signal * unit
        return signal.astype(np.float32).astype(np.float64) if quality == "single" else signal

    return Log(
        x=recorded(x, units.x),
        x_next=recorded(x_next, units.x),
        u=u * units.u,
        y=tuple(recorded(x @ C.T, unit) for C, unit in zip(grid.C, units.y, strict=True)),
        y_next=tuple(recorded(x_next @ C.T, unit) for C, unit in zip(grid.C, units.y, strict=True)),
        units=units,
        error=error,
        quality=quality,
        condition=float(values[0] / max(values[-1], 1e-300)) if columns >= n + m else 1e300,
    )


def violation(grid: Grid, node: int, gains: NodeGains, units: GridUnits, *, discrete: bool) -> float:
    """Largest relative violation of D (8) by the gains of a node, with the true matrices in the units of the record.

    A violation of the equation of E drives the error by a share of the state; of a fast error what stays counts.
    """
    x, u, y = units.x, units.u[grid.known[node]], units.y[node]
    A = grid.A * x[:, None] / x
    C = grid.C[node] * y[:, None] / x
    B = grid.B[:, grid.known[node]] * x[:, None] / u
    Bbar = grid.unknown(node) * x[:, None]
    rest = np.eye(len(A)) - gains.H @ C
    driven = (rest @ A - (gains.L - gains.E @ gains.H) @ C - gains.E) * x / x[:, None]
    E = gains.E * x / x[:, None]
    steady = np.linalg.lstsq(np.eye(len(E)) - E if discrete else E, driven, rcond=None)[0]
    least = min(float(np.max(np.abs(driven))), float(np.max(np.abs(steady))))
    wrong = (
        (gains.F - rest @ B, u),
        (rest @ Bbar, np.ones(Bbar.shape[1])),
    )
    return max(least, *(float(np.max(np.abs(one * of / x[:, None]), initial=0.0)) for one, of in wrong))
