"""The table of messages: what holds for every row, whoever adds one."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bags.mcap.bag import open_bag
from bags.mcap.blocks import block_format
from bags.mcap.topic import TopicKind
from bags.mcap.typestore import typestore
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import open_run, read_run
from bags.runs.replay import replay, replay_windows
from bags.runs.replay_bag import write_replayed
from bags.wire import forms, table
from bags.wire.arrays import columns, room, write
from bags.wire.codecs import StepCodec
from bags.wire.row import Over, Row, Widths, named
from bags.wire.schema import Parts, RunTopics, run_topics
from bags.wire.table_text import TOPICS_PAGE, table_text
from dgu_sim.grid import Link
from dgu_sim.scenario import Scenario

LINKS = (Link(2, 1), Link(1, 2), Link(3, 2), Link(2, 3))
WIDTHS = st.builds(
    Widths, outputs=st.integers(0, 6), states=st.integers(0, 6), inputs=st.integers(0, 3), applied=st.integers(0, 3)
)


@st.composite
def _topics(draw: st.DrawFn) -> RunTopics:
    parts = draw(st.none() | st.builds(Parts, local=st.booleans(), inputs=st.booleans()))
    return run_topics((1, 2, 3), LINKS, draw(st.integers(1, 10**9)), team=True, parts=parts, widths=draw(WIDTHS))


def _filled(topics: RunTopics, steps: int, seed: int) -> dict[str, NDArray[Any]]:
    """Arrays with every byte at random, flags 0 or 1."""
    rng, found = np.random.default_rng(seed), room(topics, steps)
    for name, array in found.items():
        if array.dtype.kind == "b":
            found[name] = rng.integers(0, 2, array.shape).astype(np.bool_)
        else:
            data = rng.integers(0, 256, array.nbytes, dtype=np.uint8)
            found[name] = np.frombuffer(data.tobytes(), dtype=array.dtype).reshape(array.shape)
    return found


@settings(max_examples=40, deadline=None, derandomize=True)
@given(topics=_topics(), seed=st.integers(0, 2**32), first=st.integers(0, 2**40))
def test_arrays_become_messages_and_come_back(topics: RunTopics, seed: int, first: int) -> None:
    """Whatever the widths: each array is in the messages of its row, bit for bit, and nowhere else."""
    steps, arrays = 3, _filled(topics, 3, seed)
    layout = block_format(topics.per_step, dict.fromkeys((topic.name for topic in topics.per_step), 0))
    rows = layout.block(first, steps, topics.sampling_period_ns)
    write(rows, topics, arrays)
    back = room(topics, steps)
    for column in columns(topics, back, elsewhere=False):
        for name, target in column.fields.items():
            target[:] = rows[column.topic.name][name]
    assert back.keys() == arrays.keys()
    for name, array in arrays.items():
        assert back[name].tobytes() == array.tobytes(), name


@settings(max_examples=40, deadline=None, derandomize=True)
@given(topics=_topics(), seed=st.integers(0, 2**32), step=st.integers(0, 2**40))
def test_records_become_the_same_messages(topics: RunTopics, seed: int, step: int) -> None:
    """Node and block path write the same bytes: a codec encodes what it decoded, and rosbags reads it."""
    arrays = _filled(topics, 1, seed)
    layout = block_format(topics.per_step, dict.fromkeys((topic.name for topic in topics.per_step), 0))
    rows = layout.block(step, 1, topics.sampling_period_ns)
    write(rows, topics, arrays)
    lost = {"verdict", "state"}  # bits beyond the links; a neighbour's alpha
    for column in columns(topics, arrays):
        codec: Any = topics.codec(column.row, _place(topics, column.row, column.topic.name))
        data = rows[column.topic.name].tobytes()
        typestore().deserialize_cdr(data, column.topic.type_name)
        if isinstance(codec, StepCodec) and column.row.key not in lost:
            found, record = codec.decode(data)
            assert found == step
            again = codec.encode(step, *(record if column.row.key == "input" else (record,)))
            assert again == data, column.row.key


def _place(topics: RunTopics, row: Row[Any], name: str) -> Link:
    return next(place for place in topics.places(row.over) if topics.topic(row, place).name == name)


def test_rows_stand_in_canonical_order() -> None:
    """Per-step rows, then events, then latched ones; each has a name, a meaning and a type of its own."""
    kinds = [row.kind for row in table.TABLE]
    order = [TopicKind.PER_STEP, TopicKind.EVENT, TopicKind.LATCHED]
    assert kinds == sorted(kinds, key=order.index)
    assert len({row.key for row in table.TABLE}) == len({row.says for row in table.TABLE}) == len(table.TABLE)
    assert all(row.type_name in typestore().fielddefs for row in table.TABLE)


def test_nobody_but_dgus_reads_the_truth() -> None:
    """No pattern of a monitor reads /dgu_i/state, or reads what its own row publishes."""
    assert not [one for one in table.STATE.readers if one.startswith("monitor")]
    for row in table.TABLE:
        for pattern in row.readers:
            assert named(pattern, Link(1, 2), lambda _relation, dgu: (dgu,)) != (row.publisher,)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(names=st.data())
def test_arrays_of_other_rows_are_shared(names: st.DataObject) -> None:
    """A field that stands elsewhere is the array of a row that exists, with an axis that has its places."""
    row = names.draw(st.sampled_from([row for row in table.TABLE if row.elsewhere]))
    owners = {one.key for one in table.TABLE}
    assert all(array.partition(".")[0] in owners for array in row.elsewhere.values())


def test_documents_show_the_table() -> None:
    """The page of topics is the table."""
    page = (Path(__file__).parents[3] / TOPICS_PAGE).read_text("utf-8")
    assert table_text() in page


def test_a_new_topic_is_a_row(scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One row is enough to simulate, read, replay and record anew a topic that is made of what a run has."""
    told = Row(
        key="told",
        name="/dgu_{j}/told/dgu_{i}",
        type_name="dcmg_msgs/msg/Output",
        codec=StepCodec.at,
        over=Over.LINKS,
        publisher="monitor_{j}",
        says="the estimate, as an output",
        frame="dgu_{j}",
        numbers={"source": "i"},
        sequences={"y": "states", "u": "inputs"},
        elsewhere={"y": "residual.estimate", "delivered": "residual.alarm"},
        form=forms.OUTPUT,
    )
    monkeypatch.setattr(table, "TABLE", (*table.TABLE[:12], told, *table.TABLE[12:]))
    bag = simulate_to_bag(scenario, tmp_path / "bag")
    record = read_run(bag)
    again = replay(bag)
    assert again.estimate.tobytes() == record.estimate.tobytes()
    list(write_replayed(tmp_path / "again", replay_windows(open_run(bag).windows()), {}))
    for path in (bag, tmp_path / "again"):
        found = open_bag(path).array("/dgu_2/told/dgu_1").data
        assert found["y"].tobytes() == np.ascontiguousarray(record.estimate[:, 2]).tobytes()
        assert found["source"].tolist() == [1] * record.steps


def test_a_bag_from_before_a_row_opens(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A row of which a bag has no topic is not there."""
    new = replace(table.OUTPUT, key="new", name="/dgu_{i}/new")
    monkeypatch.setattr(table, "TABLE", (*table.TABLE[:12], new, *table.TABLE[12:]))
    assert "new.y" not in read_run(bag).arrays
