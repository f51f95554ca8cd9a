"""What a recording of any origin holds: topics, counts, times, documents."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bags.mcap.bag import TopicInfo, open_bag
from bags.mcap.errors import BagError
from bags.sources.recorded import Known, open_recorded


@dataclass(frozen=True, slots=True, kw_only=True)
class Contents:
    """What a recording holds.

    Attributes:
        topics: Its topics.
        start_ns: Earliest stamp [ns].
        end_ns: Latest stamp [ns].
        attachments: Names of the documents in it.
        notes: What a person should know.
    """

    topics: tuple[TopicInfo, ...]
    start_ns: int
    end_ns: int
    attachments: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def messages(self) -> int:
        """Number of messages."""
        return sum(one.count for one in self.topics)

    def document(self) -> dict[str, Any]:
        """For JSON."""
        topics = [asdict(one) for one in self.topics]
        return {
            "messages": self.messages,
            "start_ns": self.start_ns,
            "duration_sec": (self.end_ns - self.start_ns) * 1e-9,
            "topics": [{"name": one["name"], "type": one["type_name"], "count": one["count"]} for one in topics],
            "attachments": sorted(self.attachments),
            "notes": list(self.notes),
        }


def contents(path: Path | str, known: Known | None = None) -> Contents:
    """Look into a recording; ours are not gone through, others once.

    Args:
        path: The recording.
        known: Definitions for what it does not define itself.

    Raises:
        BagError: It cannot be read.
    """
    path = Path(path)
    if path.is_dir():
        try:
            bag = open_bag(path)
        except BagError:
            pass
        else:
            if bag.is_standard() and bag.start_ns <= bag.end_ns:
                return Contents(
                    topics=tuple(bag.topics.values()),
                    start_ns=bag.start_ns,
                    end_ns=bag.end_ns,
                    attachments=tuple(bag.attachments),
                    notes=(),
                )
    with open_recorded(path, known) as recorded:
        start_ns, end_ns = 2**63, -(2**63)
        for message in recorded.messages(recorded.channels):
            start_ns, end_ns = min(start_ns, message.time_ns), max(end_ns, message.time_ns)
        topics = tuple(
            TopicInfo(
                name=topic,
                type_name=" and ".join(dict.fromkeys(one.definition.type_name for one in channels)),
                count=sum(recorded.channels[one] for one in channels),
            )
            for topic, channels in recorded.topics.items()
        )
        unreadable = [(one.name, recorded.unreadable(one.name)) for one in topics if one.count]
        there = end_ns >= start_ns
        return Contents(
            topics=topics,
            start_ns=start_ns if there else 0,
            end_ns=end_ns if there else 0,
            attachments=tuple(recorded.attachments),
            notes=(*recorded.notes, *(f"{name}: cannot be read: {reason}" for name, reason in unreadable if reason)),
        )
