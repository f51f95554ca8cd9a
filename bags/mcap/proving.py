"""Whether what a damaged file says about its messages is true: the messages themselves are read by it.

Definitions that stand in front of the chunks have no check sum. Where no summary repeats them, one is believed when
nothing contradicts it and every message of its channels can be read by it.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

from mcap.records import Channel, Schema
from rosbags.rosbag2.metadata import parse_qos

from bags.mcap.definitions import CDR, Definition, decoder_of, hash_of
from bags.mcap.errors import BagError
from bags.mcap.expand import expand
from bags.mcap.kinds import ZSTD_MAGIC
from bags.mcap.yaml_text import load

_PROFILES = "offered_qos_profiles"
_HASH = "topic_type_hash"
_HASH_HEAD = "RIHS01_"


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubts:
    """What must not be believed, and why.

    Attributes:
        channels: By number.
        schemas: By number.
    """

    channels: Mapping[int, str] = field(default_factory=dict)
    schemas: Mapping[int, str] = field(default_factory=dict)

    def about(self, channel: Channel) -> str:
        """Why a channel must not be believed, "" when nothing is known against it."""
        return self.channels.get(channel.id) or self.schemas.get(channel.schema_id, "")

    def and_those_of(self, other: "Doubts") -> "Doubts":
        """Both."""
        return Doubts(channels={**other.channels, **self.channels}, schemas={**other.schemas, **self.schemas})


@dataclass(slots=True, kw_only=True)
class Proofs:
    """Reads messages by what is said about them.

    Attributes:
        needed: False where a summary with a check sum says the same: then nothing is read.
    """

    needed: bool = True
    _begun: bool = False  # messages have come: what contradicts now stands in a broken summary
    _channels: dict[int, Channel] = field(default_factory=dict)
    _schemas: dict[int, Schema] = field(default_factory=dict)
    _topics: dict[int, str] = field(default_factory=dict)
    _readers: dict[int, Callable[[bytes], Any]] = field(default_factory=dict)
    _bad_channels: dict[int, str] = field(default_factory=dict)
    _bad_schemas: dict[int, str] = field(default_factory=dict)

    @property
    def found(self) -> Doubts:
        """What was proved wrong."""
        return Doubts(channels=self._bad_channels, schemas=self._bad_schemas)

    def meet_schema(self, schema: Schema) -> None:
        """Note a schema as the file has it; a second one with its number makes both doubtful."""
        if self.needed and not self._begun and self._schemas.setdefault(schema.id, schema) != schema:
            self._bad_schemas[schema.id] = f"two definitions have the number {schema.id}: neither is believed"

    def meet_channel(self, channel: Channel) -> None:
        """Note a channel as the file has it; a second one with its number makes both doubtful."""
        if self.needed and not self._begun and self._channels.setdefault(channel.id, channel) != channel:
            self._bad_channels[channel.id] = f"two channels have the number {channel.id}: neither is believed"

    def expect(self, channel: Channel, schema: Schema | None) -> None:
        """From now on read the messages of a channel, if anybody can."""
        self._topics[channel.id] = channel.topic
        if schema is not None and channel.message_encoding == CDR:
            with suppress(BagError, UnicodeDecodeError):  # service events: nobody reads them
                self._readers[channel.id] = decoder_of(_definition(schema)).read

    def readable(self, channel_id: int, content: bytes, start: int, end: int) -> bool:
        """Whether a message can be read by what is said about it, or nobody could."""
        reader = self._readers.get(channel_id)
        try:
            if reader is not None:
                reader(_expanded(content[start:end]))
        except BagError:
            return False
        return True

    def read(self, channel_id: int, content: bytes, start: int, end: int) -> None:
        """Read a message, the bytes from `start` to `end` of a chunk."""
        self._begun = True
        reader = self._readers.get(channel_id)
        if reader is None or not self.needed:
            return
        try:
            reader(_expanded(content[start:end]))
        except BagError as error:
            del self._readers[channel_id]
            topic = self._topics[channel_id]
            reason = f"the definition of {topic} is damaged, its messages cannot be read by it: {error}"
            self._bad_channels.setdefault(channel_id, reason)


def schema_fault_of(channel: Channel, schema: Schema | None, told: Mapping[str, str]) -> str:
    """Why a channel has no definition that every reader takes, "" when it has one or needs none.

    Args:
        channel: The channel.
        schema: Its definition, None: the file has none with its number.
        told: Type of each topic as metadata.yaml says.
    """
    if channel.message_encoding != CDR:
        return ""
    if schema is None:
        known = not channel.schema_id and channel.topic in told
        return (
            "" if known else f"the channel of {channel.topic} is damaged: nothing says of which type its messages are"
        )
    stated = channel.metadata.get(_HASH, "")
    try:
        definition = _definition(schema)
        if stated.startswith(_HASH_HEAD) and hash_of(definition) != stated:
            return f"the channel of {channel.topic} states another type hash than its definition has"
    except UnicodeDecodeError:
        return f"the definition of {channel.topic} is damaged: it is no text"
    except BagError:  # service events: nobody reads them
        pass
    return ""


def with_sound_metadata(channel: Channel) -> tuple[Channel, str]:
    """A channel without quality of service or type hash that are none, and in words that they were left out."""
    stated = channel.metadata.get(_HASH, "")
    if stated and not stated.startswith(_HASH_HEAD):
        sound, fault = with_sound_metadata(replace(channel, metadata={**channel.metadata, _HASH: ""}))
        return sound, f"the type hash of {channel.topic} is damaged: it was left out{f'; {fault}' if fault else ''}"
    if _parses(channel.metadata.get(_PROFILES, "")):
        return channel, ""
    sound = replace(channel, metadata={**channel.metadata, _PROFILES: ""})
    return sound, f"the quality of service of {channel.topic} is damaged: it was left out"


@lru_cache(maxsize=1000)
def _parses(profiles: str) -> bool:
    try:
        times = [
            time for one in parse_qos(profiles) for time in (one.deadline, one.lifespan, one.liveliness_lease_duration)
        ]
        numbers = [number for time in times for number in (time.sec, time.nsec)]
        return all(isinstance(one, int) for one in numbers) and isinstance(load(profiles) if profiles else [], list)
    except Exception:  # noqa: BLE001 - rosbags raises whatever the text leads to
        return False


def _expanded(data: bytes) -> bytes:
    """A message that may be compressed by itself."""
    return expand("zstd", data) if data[:4] == ZSTD_MAGIC else data


def _definition(schema: Schema) -> Definition:
    """Of a schema.

    Raises:
        UnicodeDecodeError: It is no text.
    """
    return Definition(type_name=schema.name, form=schema.encoding, text=schema.data.decode("utf-8"))
