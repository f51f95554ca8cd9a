"""From the rows of links to the numbers of runs: what is kept of a part while a study is summed up."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from bags.study.errors import StudyError
from bags.study.settings import NO_ATTACK

IMPACTS = ("mean_voltage_until_alarm_v", "mean_voltage_v", "sharing_until_alarm", "sharing")
"""Columns with one value for a whole run."""
_KEYS = ("condition", "observer", "detector", "swept")
RUN_BYTES = 8 * (4 + len(IMPACTS)) + 3
"""Memory of a run in `Runs`: numbers and flags."""

Pair: TypeAlias = tuple[str, str]
"""Condition and observer."""
Detecting: TypeAlias = tuple[str, float | None]
"""Detector, and the value of its swept option."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Runs:
    """The runs that one observer and one setting of one detector watched, arrays of shape (attacks, seeds).

    Attributes:
        attacks: Names.
        links: How many links a run has.
        accepted: On how many of them something watches.
        seen: Whether an attacked link alarmed during the attack.
        by_chance: Whether one of the same links alarmed in the same window in the run of the seed without an attack.
        accused: Whether a link that is not attacked alarmed during the attack.
        delay_sec: From the attack's start to the first alarm of an attacked link, NaN: none [s].
        clean_steps: Armed attack-free samples on all links.
        clean_alarm_steps: Alarms among them.
        impact: By the names of IMPACTS.
    """

    attacks: tuple[str, ...]
    links: int
    accepted: NDArray[np.int64]
    seen: NDArray[np.bool_]
    by_chance: NDArray[np.bool_]
    accused: NDArray[np.bool_]
    delay_sec: NDArray[np.float64]
    clean_steps: NDArray[np.int64]
    clean_alarm_steps: NDArray[np.int64]
    impact: Mapping[str, NDArray[np.float64]]

    @classmethod
    def joined(cls, parts: Sequence["Runs"]) -> "Runs":
        """The runs of all seeds."""
        first, arrays = parts[0], [one.name for one in fields(cls) if one.name not in {"attacks", "links", "impact"}]
        return cls(
            attacks=first.attacks,
            links=first.links,
            impact={name: np.concatenate([one.impact[name] for one in parts], axis=1) for name in IMPACTS},
            **{name: np.concatenate([getattr(one, name) for one in parts], axis=1) for name in arrays},
        )


def runs_of(table: pa.Table) -> Iterator[tuple[Pair, dict[Detecting, Runs]]]:
    """Yield the runs in a table by condition and observer.

    Raises:
        StudyError: Some rows of a run are missing.
    """
    columns = {name: table.column(name).to_numpy(zero_copy_only=False) for name in table.column_names}
    found: dict[Pair, dict[Detecting, Runs]] = {}
    for rows in _groups([table.column(name) for name in _KEYS]):
        condition, observer, detector, swept = (table.column(name)[int(rows[0])].as_py() for name in _KEYS)
        runs = _runs({name: one[rows] for name, one in columns.items() if name not in _KEYS})
        found.setdefault((condition, observer), {})[detector, swept] = runs
    yield from found.items()


def _groups(keys: Sequence[pa.ChunkedArray]) -> list[NDArray[np.intp]]:
    """Rows of each combination of keys, in the order of their appearance."""
    combined = np.zeros(len(keys[0]), dtype=np.int64)
    for key in keys:
        codes = key.combine_chunks().dictionary_encode(null_encoding="encode").indices.to_numpy(zero_copy_only=False)
        combined = combined * (int(codes.max(initial=0)) + 1) + codes
    _, first, counts = np.unique(combined, return_index=True, return_counts=True)
    rows = np.split(np.argsort(combined, kind="stable"), np.cumsum(counts)[:-1])
    return [rows[group] for group in np.argsort(first)] if len(combined) else []


def _runs(rows: Mapping[str, NDArray[Any]]) -> Runs:
    """Put the rows of one observer and one setting of one detector on axes: attacks, seeds, links."""
    attacks, seeds = tuple(dict.fromkeys(rows["attack"])), tuple(dict.fromkeys(rows["seed"]))
    numbers = {attack: number for number, attack in enumerate(attacks)}
    order = np.lexsort((rows["seed"], np.fromiter(map(numbers.__getitem__, rows["attack"]), dtype=np.int64)))
    links, odd = divmod(len(order), len(attacks) * len(seeds))
    if odd or NO_ATTACK not in numbers:
        raise StudyError(
            f"expected a row for each link of {len(attacks)} attacks x {len(seeds)} seeds: some are missing"
        )
    cube = {name: one[order].reshape(len(attacks), len(seeds), links) for name, one in rows.items()}
    attacked, detected = cube["attacked"].astype(bool), cube["detected"].astype(bool)
    delay = np.where(attacked & detected, cube["delay_sec"].astype(np.float64), np.inf).min(axis=-1)
    return Runs(
        attacks=attacks,
        links=links,
        accepted=cube["accepted"].astype(np.int64).sum(axis=-1),
        seen=(attacked & detected).any(axis=-1),
        by_chance=(attacked & detected[numbers[NO_ATTACK]]).any(axis=-1),
        accused=(~attacked & detected).any(axis=-1),
        delay_sec=np.where(np.isinf(delay), np.nan, delay),
        clean_steps=cube["clean_steps"].sum(axis=-1),
        clean_alarm_steps=cube["clean_alarm_steps"].sum(axis=-1),
        impact={name: cube[name][..., 0].copy() for name in IMPACTS},
    )
