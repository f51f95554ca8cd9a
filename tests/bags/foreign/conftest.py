"""Bags as other programs write them: with the `rosbags` library, from standard and from unheard-of message types."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

EPOCH_NS = 1_700_000_000_000_000_000
CUSTOM = "lab_msgs/msg/Plant"
CUSTOM_TEXT = "std_msgs/Header header\nlab_msgs/Cell[2] cells\nfloat32[] state\nstring name\nint64 count\nbool good\n"
CELL_TEXT = "float64[3] level\n"


@pytest.fixture(scope="session", name="store")
def _store() -> Any:  # noqa: ANN401 - rosbags makes its classes at run time
    """The standard types and two that only the bag itself defines."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(CELL_TEXT, "lab_msgs/msg/Cell"))
    store.register(get_types_from_msg(CUSTOM_TEXT, CUSTOM))
    return store


@pytest.fixture(name="write_arrays")
def _write_arrays(store: Any, tmp_path: Path) -> Callable[..., Path]:  # noqa: ANN401 - see above
    """Write Float64MultiArray messages: topic -> (recorded instants since the epoch [ns], rows)."""

    def write(
        topics: dict[str, tuple[Sequence[int], Sequence[Sequence[float]]]],
        storage: StoragePlugin = StoragePlugin.MCAP,
        name: str = "foreign",
    ) -> Path:
        kind = "std_msgs/msg/Float64MultiArray"
        layout = store.types["std_msgs/msg/MultiArrayLayout"]([], 0)
        with Writer(tmp_path / name, version=9, storage_plugin=storage) as writer:
            for topic, (stamps, rows) in topics.items():
                connection = writer.add_connection(topic, kind, typestore=store)
                for stamp, row in zip(stamps, rows, strict=True):
                    message = store.types[kind](layout, np.array(row, dtype=np.float64))
                    writer.write(connection, EPOCH_NS + int(stamp), store.serialize_cdr(message, kind))
        return tmp_path / name

    return write
