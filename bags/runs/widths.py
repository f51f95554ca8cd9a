"""How many numbers the vectors of a recorded run have: what the first message of each kind says."""

from collections.abc import Iterable

from bags.mcap.container import Container, readable
from bags.mcap.typestore import typestore_of
from bags.wire import table
from bags.wire.row import Widths
from bags.wire.schema import RunTopics


def widths_of(container: Container, topics: RunTopics) -> Widths:
    """The widths of a run.

    A stream from outside says nothing about states before somebody has designed an observer for it: the histories do,
    and without them there are as many as outputs.

    Args:
        container: The bag.
        topics: The run's topics, whatever their widths.

    Raises:
        BagError: A message is damaged.
    """
    store = typestore_of(topics.definitions)
    found: dict[str, int] = {}
    for row in (table.STATE, table.OUTPUT, table.RECEIVED, table.RESIDUAL, table.INPUT):
        data = _first(container, (topics.topic(row, place).name for place in topics.places(row.over)))
        if data is not None:
            with readable(container.path):
                message = store.deserialize_cdr(data, row.type_name)
            for name, width in row.sequences.items():
                found.setdefault(width, len(getattr(message, name, ())))
    outputs = found.get("outputs", topics.widths.outputs)
    if "states" not in found:
        names = {topics.history(dgu).topic.name: topics.history(dgu) for dgu in topics.dgus}
        data = _first(container, names)
        found["states"] = outputs if data is None else next(iter(names.values())).decode(data).x.shape[1]
    return topics.widths._replace(**{"outputs": outputs, **found})


def _first(container: Container, names: Iterable[str]) -> bytes | None:
    """The first message on one of some topics that hold any."""
    counts = container.counts
    name = next((name for name in names if counts.get(name)), None)
    if name is None:
        return None
    for _, chunk in container.chunks({name}):
        with readable(container.path):
            for channel_id, offsets in chunk.offsets.items():
                if len(offsets):
                    return next(chunk.payloads(channel_id))
    return None
