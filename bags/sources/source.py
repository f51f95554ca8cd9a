"""What a recording of any origin offers: channels, and its messages one after the other."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Protocol

from bags.mcap.definitions import Definition


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """Messages of one definition on one topic; a topic may have several, and all files of a bag share it.

    Attributes:
        topic: ROS topic name.
        definition: Of its messages.
        latched: Whether a late subscriber got what was published before.
    """

    topic: str
    definition: Definition
    latched: bool = field(default=False, compare=False)


class RawMessage(NamedTuple):
    """One message as it was recorded, decompressed.

    Attributes:
        channel: What it is of.
        time_ns: When it was recorded [ns].
        data: Its bytes.
    """

    channel: Channel
    time_ns: int
    data: bytes


class Storage(Protocol):
    """One file of a recording."""

    @property
    def path(self) -> Path:
        """The file."""

    @property
    def channels(self) -> Mapping[Channel, int]:
        """Its channels, with how many messages the file itself counts on each."""

    @property
    def attachments(self) -> Mapping[str, bytes]:
        """Documents in it by name."""

    def messages(self, wanted: Collection[Channel]) -> Iterator[RawMessage]:
        """Messages of some channels, in the order of the file."""

    def close(self) -> None:
        """Let go of the file."""
