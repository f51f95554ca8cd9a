"""Per-step messages <-> arrays of a run: which field of which message is which column of which array.

The arrays of a run go by the names that the table gives them, `residual.alarm`; behind steps and places (the axis of
the row) stand the elements of a vector.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bags.mcap.cdr import Layout
from bags.mcap.topic import Topic, TopicKind
from bags.wire.row import Row
from bags.wire.schema import RunTopics
from dgu_sim.grid import Link

Arrays: TypeAlias = Mapping[str, NDArray[Any]]
"""Arrays by the names of `Row.array`, shape (steps, places, ...)."""


class Column(NamedTuple):
    """The messages of one topic in the arrays of a run.

    Attributes:
        row: The row.
        topic: The topic.
        fields: Array of each field, shape (steps, ...); a view.
        numbers: Fields that are the same in all messages.
    """

    row: Row[Any]
    topic: Topic
    fields: dict[str, NDArray[Any]]
    numbers: dict[str, int]

    def write(self, messages: NDArray[np.void]) -> None:
        """Put the arrays into messages, shape (steps,)."""
        for name, values in (self.fields | self.numbers).items():
            messages[name] = values


def spoken(topics: RunTopics) -> tuple[Row[Any], ...]:
    """The rows that have a message at every step."""
    return tuple(row for row in topics.present if row.kind is TopicKind.PER_STEP)


def fields_of(row: Row[Any], layout: Layout) -> tuple[str, ...]:
    """The fields of a message that its record fills."""
    return tuple(name for name in layout.names if name != "step" and "." not in name and name not in row.numbers)


def room(topics: RunTopics, steps: int) -> dict[str, NDArray[Any]]:
    """Arrays for the per-step messages of some steps: NaN, 0 and False until they are there."""
    found = {}
    for row in spoken(topics):
        places = topics.places(row.over)
        layout = topics.topic(row, places[0] if places else Link(0, 0)).layout
        assert layout is not None  # noqa: S101 - a topic that speaks at every step has one
        for name in fields_of(row, layout) if row.form is not None else ():
            if name not in row.elsewhere:
                found[row.array(name)] = _empty((steps, len(places)), layout.dtype[name])
    return found


def columns(topics: RunTopics, arrays: Arrays, *, elsewhere: bool = True) -> Iterator[Column]:
    """The messages of every per-step topic of which all arrays are there, in canonical order.

    Args:
        topics: The topics.
        arrays: The arrays.
        elsewhere: Whether to give fields whose array belongs to another row.
    """
    by_key = {row.key: row for row in topics.rows}
    for row in spoken(topics):
        for place in topics.places(row.over):
            topic = topics.topic(row, place)
            assert topic.layout is not None  # noqa: S101 - a topic that speaks at every step has one
            numbers = {name: place.source if end == "i" else place.target for name, end in row.numbers.items()}
            names = fields_of(row, topic.layout) if row.form is not None else ()
            wanted = [name for name in names if elsewhere or name not in row.elsewhere]
            wanted = [name for name in wanted if topic.layout.dtype[name].itemsize]  # an empty vector says nothing
            if all(row.array(name) in arrays for name in wanted):
                fields = {}
                for name in wanted:
                    owner = by_key[row.array(name).partition(".")[0]]
                    fields[name] = arrays[row.array(name)][:, topics.places(owner.over).index(place)]
                yield Column(row, topic, fields, numbers)


def write(rows: NDArray[np.void], topics: RunTopics, arrays: Arrays) -> None:
    """Write arrays into rows as `BlockFormat.block` makes them, shape (steps,)."""
    for column in columns(topics, arrays):
        column.write(rows[column.topic.name])


def measured(topics: RunTopics, arrays: Arrays) -> dict[str, NDArray[Any]]:
    """Those of the arrays that no monitor has concluded."""
    keys = {row.key for row in topics.rows if not row.publisher.startswith("monitor_")}
    return {name: array for name, array in arrays.items() if name.partition(".")[0] in keys}


def group(arrays: Arrays, key: str) -> dict[str, NDArray[Any]]:
    """The arrays of a row by the fields of its messages."""
    return {name.partition(".")[2]: array for name, array in arrays.items() if name.partition(".")[0] == key}


def grouped(key: str, fields: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The way back."""
    return {f"{key}.{name}": array for name, array in fields.items()}


def _empty(shape: tuple[int, int], dtype: np.dtype[Any]) -> NDArray[Any]:
    base = dtype.base
    return np.full((*shape, *dtype.shape), np.nan if base.kind == "f" else 0, dtype=base)
