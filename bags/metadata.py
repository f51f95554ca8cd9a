"""`metadata.yaml` of a rosbag2 directory, version 9."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from textwrap import indent
from typing import final

from bags.qos import Qos
from bags.topic import Topic
from bags.typestore import type_hash
from bags.yaml_text import dump

METADATA_FILE = "metadata.yaml"
ROOT_KEY = "rosbag2_bagfile_information"
METADATA_VERSION = 9
ROS_DISTRO = "jazzy"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BagInfo:
    """What metadata.yaml says about a bag of one file.

    Attributes:
        file: Name of the MCAP file in the directory.
        counts: Topics with the number of their messages, in the order of the channels.
        start_ns: Earliest stamp [ns].
        end_ns: Latest stamp [ns].
        custom: Free texts by key.
    """

    file: str
    counts: Sequence[tuple[Topic, int]]
    start_ns: int
    end_ns: int
    custom: Mapping[str, str]

    def to_yaml(self) -> str:
        """The document without its outermost key, as it stands in MCAP's metadata record."""
        total = sum(count for _, count in self.counts)
        span = {
            "duration": {"nanoseconds": self.end_ns - self.start_ns},
            "starting_time": {"nanoseconds_since_epoch": self.start_ns},
            "message_count": total,
        }
        topics = [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": offered_qos(topic),
                    "type_description_hash": type_hash(topic.type_name),
                },
                "message_count": count,
            }
            for topic, count in self.counts
        ]
        information = {
            "version": METADATA_VERSION,
            "storage_identifier": "mcap",
            **_copies(span),
            "topics_with_message_count": topics,
            # the chunks inside the MCAP file are compressed, which is not what these two are about
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self.file],
            "files": [{"path": self.file, **_copies(span)}],
            "custom_data": dict(self.custom) or None,
            "ros_distro": ROS_DISTRO,
        }
        return dump(information)


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


def _copies(span: Mapping[str, object]) -> dict[str, object]:
    # equal but separate objects: YAML would abbreviate the same object to an anchor and an alias
    return {key: dict(value) if isinstance(value, dict) else value for key, value in span.items()}
