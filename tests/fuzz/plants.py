"""Random linear plants, the awkward ones on purpose: x+ = A x + B u + E d, y = C x + D u + G d, in natural units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_NEAR = (0.0, 1e-9, 1e-7, 1e-5, 1e-3)  # distances of a zero from the circle


def rank_of(matrix: Floats) -> int:
    """Rank; 0 of an empty matrix (numpy before 2 refuses it)."""
    return int(np.linalg.matrix_rank(matrix)) if matrix.size else 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """A (n, n), B (n, m), E (n, m_d), C (p, n), D (p, m), G (p, m_d); u is known online, d is not."""

    A: Floats
    B: Floats
    E: Floats
    C: Floats
    D: Floats
    G: Floats

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """States, known inputs, unknown inputs, outputs."""
        return len(self.A), self.B.shape[1], self.E.shape[1], len(self.C)

    @property
    def radius(self) -> float:
        """Spectral radius of A."""
        return float(np.max(np.abs(np.linalg.eigvals(self.A)), initial=0.0))

    def run(self, x: Floats, u: Floats, d: Floats) -> tuple[Floats, Floats]:
        """Outputs (T, p) and states (T, n) from x under u (T, m) and d (T, m_d)."""
        rows = [x]
        for known, unknown in zip(u[:-1], d[:-1], strict=True):
            rows.append(self.A @ rows[-1] + self.B @ known + self.E @ unknown)
        states = np.array(rows)
        return states @ self.C.T + u @ self.D.T + d @ self.G.T, states


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a design method can be asked for at all."""

    states: int = 12
    known: int = 2
    unknown: int = 3
    radius: float = 1.2
    feedthrough: bool = True
    needs_unknown: bool = False


def draw_plant(generator: np.random.Generator, limits: Limits) -> Plant:
    """One plant; every awkward feature has its own chance, and several may meet."""
    n = int(generator.choice(limits.states, p=_mostly_small(limits.states))) + 1
    m = int(generator.integers(0, limits.known + 1))
    m_d = int(generator.integers(1 if limits.needs_unknown else 0, min(limits.unknown, n) + 1))
    A = _dynamics(generator, n, limits.radius)
    C = _outputs(generator, n, m_d)
    plant = Plant(
        A=A,
        B=generator.standard_normal((n, m)),
        E=generator.standard_normal((n, m_d)),
        C=C,
        D=np.zeros((len(C), m)),
        G=np.zeros((len(C), m_d)),
    )
    for feature, chance in _FEATURES:
        if generator.random() < chance:
            plant = feature(generator, plant, limits)
    return plant


def _mostly_small(largest: int) -> Floats:
    weights = 1.0 / np.sqrt(1.0 + np.arange(largest))
    return np.asarray(weights / weights.sum())


def _dynamics(generator: np.random.Generator, n: int, largest: float) -> Floats:
    """A of one of several characters, turned by a random change of coordinates of moderate condition."""
    radius = float(generator.uniform(0.2, largest))
    character = generator.choice(list(_CHARACTERS), p=list(_CHARACTERS.values()))
    if character == "dense":
        A = generator.standard_normal((n, n))
        return np.asarray(A * radius / max(float(np.max(np.abs(np.linalg.eigvals(A)))), 1e-3))
    if character == "sparse":
        A = generator.standard_normal((n, n)) * (generator.random((n, n)) < 2.0 / n)
        return np.asarray(A * radius / max(float(np.max(np.abs(np.linalg.eigvals(A)))), 0.5))
    modes = {"repeated": radius, "defective": radius, "nilpotent": 0.0, "integrators": 1.0}
    A = modes[str(character)] * np.eye(n)
    if character in {"defective", "nilpotent"}:
        A = A + np.diag(generator.integers(0, 2, n - 1).astype(float), 1)
    if character == "integrators":
        A = np.diag(np.where(generator.random(n) < 0.5, 1.0, generator.uniform(-0.9, 0.9, n)))
    return _turned(generator, A)


_CHARACTERS = {
    "dense": 0.55,
    "repeated": 0.12,
    "defective": 0.11,
    "nilpotent": 0.06,
    "integrators": 0.06,
    "sparse": 0.1,
}


def _turned(generator: np.random.Generator, A: Floats) -> Floats:
    """T A T^-1 with T of condition up to 10."""
    n = len(A)
    left, _, right = np.linalg.svd(generator.standard_normal((n, n)))
    T = left @ np.diag(10.0 ** generator.uniform(-0.5, 0.5, n)) @ right
    return np.asarray(T @ A @ np.linalg.inv(T))


def _outputs(generator: np.random.Generator, n: int, m_d: int) -> Floats:
    """C: all states, some of them in any order, mixtures, more outputs than states, or one output."""
    character = generator.choice(["all", "picked", "mixed", "more", "one"], p=(0.2, 0.2, 0.35, 0.1, 0.15))
    if character == "all":
        return np.eye(n)
    p = int(generator.integers(min(max(m_d, 1), n), n + 1))
    if character == "picked":
        return np.eye(n)[generator.permutation(n)[:p]]
    if character == "more":
        C = generator.standard_normal((n + int(generator.integers(1, 4)), n))
        C[-1] = C[0]
        return C
    return generator.standard_normal((1 if character == "one" else p, n))


def _hidden_input(generator: np.random.Generator, plant: Plant, _: Limits) -> Plant:
    """One unknown input moves what no output shows at once: rank CE < rank E."""
    n, m_d, p = len(plant.A), plant.E.shape[1], len(plant.C)
    if not m_d or p >= n:
        return plant
    E = plant.E.copy()
    E[:, 0] = (np.eye(n) - np.linalg.pinv(plant.C) @ plant.C) @ generator.standard_normal(n)
    return replace(plant, E=E)


def _same_inputs(generator: np.random.Generator, plant: Plant, _: Limits) -> Plant:
    """Two unknown inputs act alike, or one acts on nothing."""
    m_d = plant.sizes[2]
    if m_d < 2:
        return plant
    E = plant.E.copy()
    E[:, 1] = float(generator.integers(0, 2)) * E[:, 0]
    return replace(plant, E=E)


def _unobservable(generator: np.random.Generator, plant: Plant, limits: Limits) -> Plant:
    """A part of the state that shows in no output, stable or not."""
    n = plant.sizes[0]
    hidden = int(generator.integers(1, 3))
    if n + hidden > limits.states:
        return plant
    own = np.diag(generator.uniform(-limits.radius, limits.radius, hidden))
    joined = block_diag(plant.A, own)
    joined[n:, :n] = generator.standard_normal((hidden, n))
    left = np.linalg.qr(generator.standard_normal((n + hidden, n + hidden)))[0]
    below = [np.vstack([part, generator.standard_normal((hidden, part.shape[1]))]) for part in (plant.B, plant.E)]
    C = np.hstack([plant.C, np.zeros((len(plant.C), hidden))])
    return replace(plant, A=left @ joined @ left.T, B=left @ below[0], E=left @ below[1], C=C @ left.T)


def _chosen_zeros(generator: np.random.Generator, plant: Plant, _: Limits) -> Plant:
    """As many outputs as unknown inputs, with zeros where we want them: inside, at, outside the circle, repeated."""
    n, m, m_d = len(plant.A), plant.B.shape[1], plant.E.shape[1]
    if not 0 < m_d < n:
        return plant
    q = n - m_d
    size = float(generator.choice([0.5, 1.3, 0.95])) if generator.random() < 0.5 else _next_to_one(generator)
    Z = size * np.eye(q) if generator.random() < 0.3 else np.diag(size * generator.uniform(-1.0, 1.0, q))
    Z[0, 0] = size * float(generator.choice([-1.0, 1.0]))
    if generator.random() < 0.2:
        Z = Z + np.diag(np.ones(q - 1), 1)
    E1, E2 = np.linalg.qr(generator.standard_normal((m_d, m_d)))[0], generator.standard_normal((q, m_d))
    A11, A21 = generator.standard_normal((m_d, m_d)), 0.3 * generator.standard_normal((q, m_d))
    A12 = 0.3 * generator.standard_normal((m_d, q))
    A = np.block([[0.3 * A11, A12], [A21, Z + E2 @ np.linalg.solve(E1, A12)]])
    T = np.linalg.qr(generator.standard_normal((n, n)))[0]
    C = np.hstack([np.eye(m_d), np.zeros((m_d, q))]) @ T.T
    E = T @ np.vstack([E1, E2])
    radius = float(np.max(np.abs(np.linalg.eigvals(A))))
    if radius > 2.0:
        return plant
    return replace(plant, A=T @ A @ T.T, E=E, C=C, D=np.zeros((m_d, m)), G=np.zeros((m_d, m_d)))


def _next_to_one(generator: np.random.Generator) -> float:
    return 1.0 + float(generator.choice([-1.0, 1.0])) * float(generator.choice(_NEAR))


def _known_feedthrough(generator: np.random.Generator, plant: Plant, limits: Limits) -> Plant:
    """Known inputs act on outputs at once."""
    if not limits.feedthrough:
        return plant
    return replace(plant, D=generator.standard_normal(plant.D.shape))


def _unknown_feedthrough(generator: np.random.Generator, plant: Plant, limits: Limits) -> Plant:
    """Some unknown inputs act on outputs at once."""
    if not limits.feedthrough:
        return plant
    acting = generator.random(plant.G.shape[1]) < 0.7
    return replace(plant, G=generator.standard_normal(plant.G.shape) * acting)


def _small_row(generator: np.random.Generator, plant: Plant, _: Limits) -> Plant:
    """One output is a thousandth of the others, or one state is hardly seen."""
    C = plant.C.copy()
    C[int(generator.integers(len(C)))] *= 1e-3
    return replace(plant, C=C, D=plant.D, G=plant.G)


_FEATURES: tuple[tuple[Callable[[np.random.Generator, Plant, Limits], Plant], float], ...] = (
    (_chosen_zeros, 0.2),
    (_hidden_input, 0.1),
    (_same_inputs, 0.05),
    (_unobservable, 0.12),
    (_known_feedthrough, 0.12),
    (_unknown_feedthrough, 0.08),
    (_small_row, 0.05),
)
