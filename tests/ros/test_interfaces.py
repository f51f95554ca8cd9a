"""The messages and services that CMake built from ros_ws/src/dcmg_msgs, as Python sees them."""

from __future__ import annotations

import json
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import dcmg_msgs
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.type_support import check_for_type_support

SOURCES = Path(__file__).parents[2] / "ros_ws" / "src" / "dcmg_msgs"
MESSAGES = sorted(path.stem for path in SOURCES.glob("msg/*.msg"))
SERVICES = sorted(path.stem for path in SOURCES.glob("srv/*.srv"))
RIHS01 = re.compile(r"RIHS01_[0-9a-f]{64}")


def share(name: str) -> Path:
    """Return a file that the build installed for other programs: PREFIX/share/dcmg_msgs/NAME."""
    prefix = Path(dcmg_msgs.__file__).parents[4]
    return prefix / "share" / "dcmg_msgs" / name


@pytest.mark.parametrize("name", MESSAGES)
def test_message_survives_the_wire(name: str) -> None:
    """Every .msg file is a Python class whose instances come back from their wire bytes unchanged."""
    message_type: Any = getattr(import_module("dcmg_msgs.msg"), name)
    message = message_type()
    if hasattr(message, "step"):
        message.step = 2**40 + 7
    assert deserialize_message(serialize_message(message), message_type) == message


@pytest.mark.parametrize("name", SERVICES)
def test_service_has_both_halves(name: str) -> None:
    """Every .srv file is a Python class with type support for the request and the response."""
    service: Any = getattr(import_module("dcmg_msgs.srv"), name)
    for half in (service.Request, service.Response):
        check_for_type_support(half)
        assert deserialize_message(serialize_message(half()), half) == half()


@pytest.mark.parametrize("name", [f"msg/{name}" for name in MESSAGES] + [f"srv/{name}" for name in SERVICES])
def test_type_hash_is_installed(name: str) -> None:
    """Every type has its RIHS01 hash and its definition in share/, where recorders look for them."""
    hashes = json.loads(share(f"{name}.json").read_text())["type_hashes"]
    own = {entry["type_name"]: entry["hash_string"] for entry in hashes}[f"dcmg_msgs/{name}"]
    assert RIHS01.fullmatch(own)
    assert share(f"{name}.{name[:3]}").is_file()
