"""Recordings of other programs published into ROS: what is in them arrives, and what cannot be published is named."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bags.mcap.repair import repair
from bags.mcap.typestore import typestore
from dcmg_nodes.foreign_types import differing_type

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

KIND = "geometry_msgs/msg/Vector3"
COUNT = 20
# Writes down what comes on a topic, byte for byte.
_LISTENER = f"""
import sys, time
import rclpy
from geometry_msgs.msg import Vector3
from rclpy.node import Node

rclpy.init()
node, found = Node("listener", enable_rosout=False, start_parameter_services=False), []
subscription = node.create_subscription(Vector3, sys.argv[1], lambda data: found.append(data.hex()), 100, raw=True)
until = time.monotonic() + 60.0
while time.monotonic() < until and len(found) < {COUNT}:
    rclpy.spin_once(node, timeout_sec=0.1)
print(" ".join(found))
"""


def _write(path: Path, topics: dict[str, str], plugin: StoragePlugin, mode: CompressionMode) -> list[str]:
    """Write a bag with the `rosbags` library; the messages of each topic as they are to arrive."""
    payloads = [
        bytes(typestore().serialize_cdr(typestore().types[KIND](float(number), 2.0, -3.0), KIND))
        for number in range(COUNT)
    ]
    store = typestore()
    writer = Writer(path, version=9, storage_plugin=plugin)
    if mode is not CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        for topic, type_name in topics.items():
            text = None if type_name in store.fielddefs else "float64 x\nfloat64 w\n"
            connection = (
                writer.add_connection(topic, type_name, typestore=store)
                if text is None
                else writer.add_connection(topic, type_name, msgdef=text, rihs01="RIHS01_0")
            )
            for number, data in enumerate(payloads):
                writer.write(connection, number * 10_000_000, data)
    return [one.hex() for one in payloads]


def _without_definitions(bag: Path) -> None:
    """As ROS 2 up to Humble wrote it: neither definitions nor type hashes."""
    (database,) = bag.glob("*.db3")
    with sqlite3.connect(database) as found:
        found.execute("DROP TABLE message_definitions")
        found.execute("UPDATE topics SET type_description_hash = ''")


def _publish(dcmg: Callable[..., Any], domain: int, bag: Path, heard: str, *options: object) -> tuple[Any, list[str]]:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    command = [sys.executable, "-c", _LISTENER, heard]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as listener:
        try:
            chosen = ("--rate", "max", "--domain", domain, "--json", "--wait-for", heard, *options)
            done = dcmg("replay", bag, "--publish", *chosen)
            if done.code not in {0, 3}:
                listener.kill()
            return done, (listener.communicate(timeout=90.0)[0] or "").split()
        finally:
            listener.kill()


def test_messages_that_are_compressed_each_by_itself_arrive_as_they_were_sent(
    dcmg: Callable[..., Any], free_domain: int, tmp_path: Path
) -> None:
    """Subscribers get what was recorded, not what the file made of it; after a repair as well."""
    sent = _write(tmp_path / "bag", {"/a": KIND}, StoragePlugin.MCAP, CompressionMode.MESSAGE)
    repair(tmp_path / "bag", tmp_path / "repaired")
    done, found = _publish(dcmg, free_domain, tmp_path / "repaired", "/a")
    assert done.code == 0, done.err
    assert found == sent


def test_what_can_be_published_is_and_the_rest_is_named(
    dcmg: Callable[..., Any], free_domain: int, tmp_path: Path
) -> None:
    """No definitions, a name that ROS does not take, an uninstalled type: exit code 3, and the rest arrives."""
    topics = {"/a": KIND, "/a-b": KIND, "/own": "lab_msgs/msg/Own"}
    sent = _write(tmp_path / "bag", topics, StoragePlugin.SQLITE3, CompressionMode.NONE)
    _without_definitions(tmp_path / "bag")
    folder = tmp_path / "defined" / "geometry_msgs" / "msg"
    folder.mkdir(parents=True)
    (folder / "Vector3.msg").write_text("float64 x\nfloat64 y\nfloat64 z\n")
    done, found = _publish(dcmg, free_domain, tmp_path / "bag", "/a", "--definitions", tmp_path / "defined")
    assert done.code == 3
    assert found == sent
    document = json.loads(done.out)
    assert document["topics"] == {"/a": COUNT}
    assert set(document["left_out"]) == {"/a-b", "/own"}
    assert "--remap /a-b:=NEW" in document["left_out"]["/a-b"]
    assert "is not installed here" in document["left_out"]["/own"]
    assert f"left out, because it cannot be published: /a-b ({COUNT} messages), /own ({COUNT} messages)" in done.err


def test_a_bag_of_which_nothing_can_be_published_ends_at_once(
    dcmg: Callable[..., Any], free_domain: int, tmp_path: Path
) -> None:
    """Exit code 3 and the reason, though it is to be played for ever."""
    path = tmp_path / "x.bag"
    with Ros1Writer(path) as writer:
        connection = writer.add_connection("/a", KIND, typestore=get_typestore(Stores.ROS1_NOETIC))
        for number in range(COUNT):
            writer.write(connection, number, bytes(24))
    done = dcmg("replay", path, "--publish", "--loop", "--domain", free_domain)
    assert done.code == 3
    assert f"left out, because it cannot be published: /a ({COUNT} messages)" in done.err
    assert "its messages are encoded as ros1" in done.err


@pytest.mark.parametrize(
    ("text", "other"),
    [
        ("float64 x\nfloat64 y\nfloat64 z\n", None),
        ("float64 y\nfloat64 x\nfloat64 z\n", KIND),
        ("float32 x\nfloat32 y\nfloat32 z\n", KIND),
        ("float64 x\nfloat64 y\n", KIND),
    ],
)
def test_a_type_that_was_another_one_is_not_published(text: str, other: str | None) -> None:
    """Where no type hash tells, the fields are held against those of the installed type: no column is swapped."""
    recorded = {name: fields for name, (_, fields) in get_types_from_msg(text, KIND).items()}
    assert differing_type(KIND, recorded) == other
