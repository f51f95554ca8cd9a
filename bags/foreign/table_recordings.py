"""Tables as recordings: instants from a column, blanks as missing values or as rows that are not there."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bags.foreign.columns import Table, read_columns
from bags.foreign.mapping import Mapping, Signal
from bags.foreign.sampling import Policy
from bags.foreign.tables import open_table
from bags.foreign.track import Recording
from bags.foreign.units import LONG_TIMES, SHORT_TIMES, stated_factor
from bags.mcap.errors import BagError

_SECOND_NS = 1_000_000_000
_BRIDGING = frozenset({Policy.HOLD, Policy.LINEAR})


def read_table_recordings(
    source: Path, fields: Sequence[str], mapping: Mapping
) -> tuple[tuple[Recording, ...], tuple[str, ...]]:
    """Read the wanted columns of a table.

    With `hold` and `linear` every column is a track of its own and a blank no sample of it, so that what was measured
    more slowly is bridged; otherwise a blank is a missing value.

    Args:
        source: The table.
        fields: Columns.
        mapping: Names the column of instants, or states the sampling period.

    Returns:
        The recordings, and what a person should know.

    Raises:
        BagError: A column is missing, stands there twice, or holds something besides numbers or instants.
    """
    table = open_table(source)
    names = list(dict.fromkeys(fields))
    columns = read_columns(table, [*names, *([mapping.time.field] if mapping.time else [])])
    units = {one.name: one.unit for one in table.columns}
    for name in names:
        if columns[name].dtype.kind == "i":
            raise BagError(f"{source}: column {name} holds times, expected numbers")
    rows = len(columns[names[0]])
    if not rows:
        raise BagError(f"{source}: holds 0 rows, expected at least one")
    stamps = _stamps(table, columns, mapping, rows, units)
    notes = [*table.notes, *_blank_notes(columns, names)]
    values = np.stack([columns[name] for name in names], axis=1).astype(np.float64, copy=False)
    if mapping.sampling.policy not in _BRIDGING:
        found = Recording(
            name=source.name,
            fields=tuple(names),
            stamps_ns=stamps,
            values=values,
            units=tuple(units[one] for one in names),
        )
        return (found,), tuple(notes)
    tracks = []
    for position, name in enumerate(names):
        there = np.isfinite(values[:, position])
        if not there.any():
            raise BagError(f"{source}: column {name} holds no number, expected some")
        tracks.append(
            Recording(
                name=f"{source.name} {name}",
                fields=(name,),
                stamps_ns=stamps[there],
                values=values[there, position : position + 1],
                units=(units[name],),
            )
        )
    return tuple(tracks), tuple(notes)


def _stamps(
    table: Table,
    columns: dict[str, NDArray[np.float64] | NDArray[np.int64]],
    mapping: Mapping,
    rows: int,
    units: dict[str, str],
) -> NDArray[np.int64]:
    if mapping.time is None:
        if mapping.period_ns is None:
            raise BagError(f"{table.file}: found no key time, expected it or sampling_period_sec")
        return np.arange(rows, dtype=np.int64) * mapping.period_ns
    times = columns[mapping.time.field]
    if times.dtype.kind == "i":
        if mapping.time.factor != 1.0:
            raise BagError(f"{table.file}: column {mapping.time.field} holds dates, expected no unit or factor for it")
        return times.astype(np.int64) + round(mapping.time.offset * _SECOND_NS)
    factor = mapping.time.factor * _time_unit(table.file, mapping.time, units[mapping.time.field])
    instants = times * (factor * _SECOND_NS) + mapping.time.offset * _SECOND_NS
    wrong = np.flatnonzero(~(np.abs(instants) < 2.0**62))
    if len(wrong):
        where, number = table.where(int(wrong[0])), times[wrong[0]]
        if np.isfinite(number):
            raise BagError(
                f"{table.file}: column {mapping.time.field} holds {number:.15g} in {where}, no instant in seconds: "
                f"expected a unit, as in --time '{mapping.time.field}*0.001' for milliseconds"
            )
        raise BagError(f"{table.file}: column {mapping.time.field} holds no instant in {where}, expected a number")
    return np.rint(instants).astype(np.int64)


def _time_unit(file: Path, signal: Signal, unit: str) -> float:
    """What the table itself says about its clock, where the mapping says nothing."""
    word = unit.partition(" since ")[0].strip()
    if not word or not signal.is_bare:
        return 1.0
    word = SHORT_TIMES.get(word.lower(), word)
    if word.lower() in LONG_TIMES:
        return LONG_TIMES[word.lower()]
    factor = stated_factor(word) if word.endswith("s") else 0.0
    if not factor or (factor == 1.0 and word != "s"):
        raise BagError(
            f"{file}: column {signal.field} is in {unit!r}, expected s, ms, us or ns, or a unit in the mapping"
        )
    return factor


def _blank_notes(columns: dict[str, NDArray[np.float64] | NDArray[np.int64]], names: Sequence[str]) -> list[str]:
    notes = []
    for name in names:
        blank = int((~np.isfinite(columns[name])).sum())
        if blank:
            notes.append(f"{name}: {blank} of {len(columns[name])} cells hold no number (blank, NaN or the like)")
    return notes
