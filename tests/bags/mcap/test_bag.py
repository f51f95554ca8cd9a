"""The public reader, and tables for other programs."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from bags.mcap.bag import open_bag
from bags.mcap.errors import BagError
from bags.mcap.topic import Topic, TopicKind
from bags.mcap.typestore import typestore
from bags.mcap.writer import BagWriter
from bags.runs.run_record import RunRecord

DOCS = Path(__file__).parents[3] / "docs" / "bags.md"


def test_blocks_are_the_run(bag: Path, record: RunRecord) -> None:
    """Block by block or at once, a topic holds the bits that read_run finds, with the stamps of its steps."""
    opened = open_bag(bag)
    assert opened.topics["/dgu_1/state"].count == record.steps
    assert (opened.start_ns, opened.end_ns) == (0, 2_390_000_000)
    whole = opened.array("/dgu_1/state")
    assert whole.data["x"].tobytes() == np.ascontiguousarray(record.x[:, 0]).tobytes()
    assert whole.time_ns.tolist() == [10_000_000 * step for step in range(record.steps)]
    assert set(whole.data["header.frame_id"]) == {b"dgu_1"}
    blocks = list(opened.blocks("/dgu_2/residual/dgu_1", rows=1))
    residual = np.concatenate([one.data["residual"] for one in blocks])
    position = [str(link) for link in record.links].index("1-2")
    assert residual.tobytes() == np.ascontiguousarray(record.residual[:, position]).tobytes()


def test_messages_are_the_bytes(bag: Path, record: RunRecord) -> None:
    """Messages of any length come as their bytes."""
    opened = open_bag(bag)
    tick = record.topics.tick()
    assert [(time, tick.decode(data)[0]) for time, data in opened.messages("/tick")] == [
        (record.topics.stamp_ns(step), step) for step in range(record.steps)
    ]
    histories = list(opened.messages("/dgu_1/history"))
    assert len(histories) == len([one for one in record.histories if one.dgu == 1])
    assert {time for time, _ in histories} == {0}


def test_what_cannot_be_read_is_named(bag: Path, tmp_path: Path) -> None:
    """Unknown topics, sequences that vary in length and empty topics are one line each."""
    opened = open_bag(bag)
    with pytest.raises(BagError, match="holds no topic '/nothing', expected one of /clock /tick"):
        opened.array("/nothing")
    with pytest.raises(BagError, match=r"field u has no fixed length"):
        opened.array("/dgu_1/history")
    chatter = Topic(name="/chatter", type_name="std_msgs/msg/String", publishers=("x",), kind=TopicKind.EVENT)
    with BagWriter(tmp_path / "bag", [chatter]) as writer:
        for text in ("one", "three"):
            message = typestore().types[chatter.type_name](data=text)
            writer.write("/chatter", 0, bytes(typestore().serialize_cdr(message, chatter.type_name)))
    assert open_bag(tmp_path / "bag").array("/chatter").data["data"].tolist() == [b"one", b"three"]
    BagWriter(tmp_path / "empty", [chatter]).close()
    with pytest.raises(BagError, match="/chatter holds no message"):
        open_bag(tmp_path / "empty").array("/chatter")


def test_snippets_of_the_docs(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What docs/bags.md shows runs as it stands, one snippet after the other."""
    copy = tmp_path / "run"  # the last snippet writes beside the bag
    shutil.copytree(bag, copy)
    names: dict[str, object] = {}
    for snippet in re.findall(r"```python\n(.*?)```", DOCS.read_text("utf-8"), re.DOTALL):
        exec(snippet.replace("out/run", str(copy)), names)  # noqa: S102 - our own documentation
    assert "/dgu_1/state dcmg_msgs/msg/State 240" in capsys.readouterr().out
