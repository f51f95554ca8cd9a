"""Three readers of one bag: ours, the mcap library with its ROS 2 decoder, and rosbags."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from bags.sources.recorded import open_recorded

if TYPE_CHECKING:
    from pathlib import Path


def decoded_by_all(bag: Path) -> list[int]:
    """Number of messages that each of the three reads and decodes.

    Raises:
        Exception: whatever a reader says of a bag that it refuses.
    """
    counts = [0, 0, 0]
    with open_recorded(bag) as recorded:
        for channel, _, data in recorded.messages(recorded.channels):
            decoder = recorded.decoders[channel]
            assert not isinstance(decoder, str), decoder
            decoder.read(data)
            counts[0] += 1
    for file in bag.glob("*.mcap"):
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            counts[1] += sum(1 for _ in reader.iter_decoded_messages(log_time_order=False))
    with AnyReader([bag]) as others:
        for connection, _, data in others.messages():
            others.deserialize(data, connection.msgtype)
            counts[2] += 1
    return counts


def refused_by(bag: Path) -> str:
    """Why the three do not read the same, "" when they do."""
    try:
        counts = decoded_by_all(bag)
    except Exception as error:  # noqa: BLE001 - whatever the readers raise is the finding
        return f"a reader refuses the bag: {type(error).__name__}: {error}"
    return "" if len(set(counts)) == 1 else f"three readers find {counts} messages"
