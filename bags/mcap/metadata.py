"""`metadata.yaml` of a rosbag2 directory, version 9."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from textwrap import indent

from bags.mcap.qos import Qos
from bags.mcap.topic import Topic
from bags.mcap.typestore import type_hash
from bags.mcap.yaml_text import dump

METADATA_FILE = "metadata.yaml"
ROOT_KEY = "rosbag2_bagfile_information"
METADATA_VERSION = 9
ROS_DISTRO = "jazzy"


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicEntry:
    """What metadata.yaml says about one topic.

    Attributes:
        name: ROS topic name.
        type_name: Full message type name.
        offered_qos: The QoS profiles of its publishers.
        type_hash: RIHS01 hash of the type.
        count: Number of messages.
    """

    name: str
    type_name: str
    offered_qos: Sequence[object]
    type_hash: str
    count: int

    @classmethod
    def of(cls, topic: Topic, count: int) -> "TopicEntry":
        """The entry of a topic of ours."""
        return cls(
            name=topic.name,
            type_name=topic.type_name,
            offered_qos=offered_qos(topic),
            type_hash=type_hash(topic.type_name, topic.definitions),
            count=count,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FileEntry:
    """What metadata.yaml says about one file of the bag.

    Attributes:
        name: File name in the directory.
        start_ns: Earliest stamp [ns].
        end_ns: Latest stamp [ns].
        count: Number of messages.
    """

    name: str
    start_ns: int
    end_ns: int
    count: int

    def span(self) -> dict[str, object]:
        """Start, duration and count in the words of rosbag2."""
        return {
            "duration": {"nanoseconds": self.end_ns - self.start_ns},
            "starting_time": {"nanoseconds_since_epoch": self.start_ns},
            "message_count": self.count,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class BagInfo:
    """What metadata.yaml says about a bag.

    Attributes:
        files: The MCAP files in the order of time.
        topics: Topics in the order of the channels.
        custom: Free texts by key.
        ros_distro: Whose types they are.
        compressed: Whether each message is compressed by itself, with zstd.
    """

    files: Sequence[FileEntry]
    topics: Sequence[TopicEntry]
    custom: Mapping[str, str]
    ros_distro: str = ROS_DISTRO
    compressed: bool = False

    def to_yaml(self) -> str:
        """The document without its outermost key, as it stands in MCAP's metadata record."""
        filled = [one for one in self.files if one.count] or self.files[:1]
        whole = FileEntry(
            name="",
            start_ns=min(one.start_ns for one in filled),
            end_ns=max(one.end_ns for one in filled),
            count=sum(one.count for one in self.files),
        )
        topics = [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",  # of others, too: rosbags would refuse the whole bag
                    "offered_qos_profiles": topic.offered_qos,
                    "type_description_hash": topic.type_hash,
                },
                "message_count": topic.count,
            }
            for topic in self.topics
        ]
        information = {
            "version": METADATA_VERSION,
            "storage_identifier": "mcap",
            **whole.span(),
            "topics_with_message_count": topics,
            # the chunks inside the MCAP file are compressed, which is not what these two are about
            "compression_format": "zstd" if self.compressed else "",
            "compression_mode": "MESSAGE" if self.compressed else "",
            "relative_file_paths": [one.name for one in self.files],
            "files": [{"path": one.name, **one.span()} for one in self.files],
            "custom_data": dict(self.custom) or None,
            "ros_distro": self.ros_distro,
        }
        return dump(information)


def write_metadata(folder: Path, information: str) -> None:
    """Write metadata.yaml; it is there as a whole or not at all.

    Args:
        folder: The bag's directory.
        information: What `BagInfo.to_yaml` gave.

    Raises:
        OSError: The disk refuses.
    """
    draft = folder / f"{METADATA_FILE}.tmp"
    try:
        draft.write_text(whole_document(information), "utf-8")
        draft.replace(folder / METADATA_FILE)
    except OSError:
        draft.unlink(missing_ok=True)
        raise


def whole_document(information: str) -> str:
    """The document of metadata.yaml around what `BagInfo.to_yaml` gave."""
    return f"{ROOT_KEY}:\n{indent(information, '  ')}"


def offered_qos(topic: Topic) -> list[dict[str, object]]:
    """The QoS profiles of all publishers of a topic."""
    return [topic.qos.to_metadata() for _ in topic.publishers]


def offered_qos_text(topic: Topic) -> str:
    """The same as YAML, as it stands in the metadata of a channel."""
    return _qos_text(topic.qos, len(topic.publishers))


@cache
def _qos_text(qos: Qos, publishers: int) -> str:
    return dump([qos.to_metadata() for _ in range(publishers)]).strip()
