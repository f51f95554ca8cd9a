"""Histories of a plant as people record them: exact, rounded, noisy, short, with gaps, weakly excited, in any unit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.history import Experiment, History

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tests.fuzz.plants import Plant

    Floats = NDArray[np.float64]

_ROUNDING = 2.3e-16
_SINGLE = 6e-8  # half a unit in the last place of a float32
_GROWTH = 1e4  # an unstable plant may grow by this within an experiment


@dataclass(frozen=True, slots=True, kw_only=True)
class Units:
    """What one natural unit of each component of u, y, x, d is in the history."""

    u: Floats
    y: Floats
    x: Floats
    d: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A history, and what nobody tells the design about it.

    Attributes:
        history: as it is handed over.
        units: of its columns.
        tables: u, x, d of the experiments in natural units, before rounding, noise and gaps.
        size: (m_d,) how far each unknown input was moved.
        mean: (m_d,) operating point of the unknown inputs.
        known: (m,) how far each known input was moved.
        error: relative size of what is wrong with every sample of x: rounding or noise.
        quality: in one word.
    """

    history: History
    units: Units
    tables: tuple[tuple[Floats, Floats, Floats], ...]
    size: Floats
    mean: Floats
    known: Floats
    error: float
    quality: str

    @property
    def in_words(self) -> str:
        """Quality, units, excitation in a few words."""
        units = np.concatenate([self.units.u, self.units.y, self.units.x])
        words = [self.quality + (f" {self.error:.0e}" if self.quality == "noise" else "")]
        words += [f"units {units.min():.0e} to {units.max():.0e}"] if np.any(units != 1.0) else []
        weakest = float(min(self.size.min(initial=1.0), self.known.min(initial=1.0)))
        words += [f"weakest input {weakest:.0e}"] if weakest < 1.0 else []
        return f"{len(self.tables)}x{len(self.tables[0][1])} samples, {', '.join(words)}"

    @property
    def whole(self) -> list[NDArray[np.bool_]]:
        """For each experiment which samples hold no gap."""
        return [complete(one.u, one.y, one.x) for one in self.history.experiments]  # observers do not use d


def complete(*tables: Floats) -> NDArray[np.bool_]:
    """Which samples hold no gap."""
    return np.asarray(np.isfinite(np.hstack(tables)).all(axis=1), dtype=np.bool_)


@dataclass(frozen=True, slots=True, kw_only=True)
class Needs:
    """What a method needs of a record: how many columns it spans, and how long an experiment must be."""

    columns: int
    shortest: int = 6
    exact_only: bool = False


def draw_recording(generator: np.random.Generator, plant: Plant, needs: Needs) -> Recording:
    """One history of a plant."""
    units = _units(generator, plant)
    quality = "exact" if needs.exact_only else str(generator.choice(_QUALITIES, p=_CHANCES))
    m, m_d = plant.B.shape[1], plant.E.shape[1]
    size: Floats = np.ones(m_d)
    mean: Floats = np.zeros(m_d)
    known: Floats = np.ones(m)
    if m_d and generator.random() < 0.2:
        size[int(generator.integers(m_d))] = float(generator.choice([1e-2, 1e-4, 1e-6, 1e-8]))
    if m and generator.random() < 0.1:
        known[int(generator.integers(m))] = 1e-8 * float(generator.integers(0, 2))
    if generator.random() < 0.25:
        mean += generator.uniform(-50.0, 50.0, m_d)
    tables = _tables(generator, plant, needs, (size, mean, known))
    error = {"single": _SINGLE, "noise": 10.0 ** float(generator.uniform(-6.0, -1.5))}.get(quality, _ROUNDING)
    experiments = tuple(_as_recorded(generator, plant, table, units, (quality, error)) for table in tables)
    if quality == "twice":
        experiments = (*experiments, *experiments)
    return Recording(
        history=History(experiments, 0.01),
        units=units,
        tables=tables,
        size=size,
        mean=mean,
        known=known,
        error=error,
        quality=quality,
    )


_QUALITIES = ("exact", "single", "noise", "gaps", "twice")
_CHANCES = (0.65, 0.1, 0.12, 0.08, 0.05)


def _units(generator: np.random.Generator, plant: Plant) -> Units:
    n, m, m_d, p = plant.sizes
    if generator.random() < 0.5:
        return Units(u=np.ones(m), y=np.ones(p), x=np.ones(n), d=np.ones(m_d))
    reach = float(generator.choice([3.0, 8.0]))
    drawn = [10.0 ** generator.uniform(-reach, reach, count) for count in (m, p, n, m_d)]
    return Units(u=drawn[0], y=drawn[1], x=drawn[2], d=drawn[3])


def _tables(
    generator: np.random.Generator, plant: Plant, needs: Needs, sizes: tuple[Floats, Floats, Floats]
) -> tuple[tuple[Floats, Floats, Floats], ...]:
    """Inputs and states of all experiments: one long one where the plant allows it, else many short ones."""
    n, m, m_d, _ = plant.sizes
    size, mean, known = sizes
    amount = generator.choice(["plenty", "spare", "scarce"], p=(0.75, 0.15, 0.1))
    columns = needs.columns * (3 if amount == "plenty" else 1)
    columns += int(generator.integers(10, 40)) if amount != "scarce" else int(generator.integers(-4, 5))
    longest = int(np.log(_GROWTH) / np.log(plant.radius)) if plant.radius > 1.0 + 1e-6 else 10**6
    length = min(columns + needs.shortest, longest)
    if generator.random() < 0.4:
        length = min(length, needs.shortest + int(generator.integers(4, 20)))
    length = max(length, needs.shortest)
    count = max(1, -(-columns // (length - needs.shortest + 2)))
    tables = []
    for _ in range(count):
        u = known * generator.uniform(-1.0, 1.0, (length, m))
        d = mean + size * generator.uniform(-1.0, 1.0, (length, m_d))
        x = plant.run(generator.uniform(-1.0, 1.0, n), u, d)[1]
        tables.append((u, x, d))
    return tuple(tables)


def _as_recorded(
    generator: np.random.Generator,
    plant: Plant,
    table: tuple[Floats, Floats, Floats],
    units: Units,
    damage: tuple[str, float],
) -> Experiment:
    u, x, d = table
    quality, error = damage
    y = x @ plant.C.T + u @ plant.D.T + d @ plant.G.T
    if quality == "noise":
        x = x + error * generator.standard_normal(x.shape)
        y = y + error * generator.standard_normal(y.shape)
    u, y, x, d = u * units.u, y * units.y, x * units.x, d * units.d
    if quality == "single":
        u, y, x, d = (signal.astype(np.float32).astype(np.float64) for signal in (u, y, x, d))
    if quality == "gaps":
        for signal in (y, x):
            signal[generator.random(signal.shape) < 0.3 / signal.size**0.5] = np.nan
    return Experiment(u, y, x, None, d)
