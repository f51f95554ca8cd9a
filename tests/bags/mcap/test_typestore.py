"""Definitions, schema texts and hashes of the message types."""

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bags.mcap.errors import BagError
from bags.mcap.typestore import schema_text, type_hash, typestore

OWN = sorted(name for name in typestore().fielddefs if name.startswith("dcmg_msgs/"))


def test_every_message_file_is_registered() -> None:
    """The types of the recorded topics are known under the name of their ROS package."""
    for name in ("Tick", "State", "Output", "Residual", "Alarm", "AttackEvent", "History", "Design"):
        assert f"dcmg_msgs/msg/{name}" in OWN


@pytest.mark.parametrize("type_name", OWN)
def test_schema_text_alone_defines_the_type(type_name: str) -> None:
    """A stranger who has only the schema finds the same fields and the same hash."""
    stranger = get_typestore(Stores.EMPTY)
    stranger.register(get_types_from_msg(schema_text(type_name), type_name))
    assert stranger.fielddefs[type_name] == typestore().fielddefs[type_name]
    assert stranger.hash_rihs01(type_name) == type_hash(type_name)


def test_units_travel_with_the_schema() -> None:
    """The comments of our own definitions, which state the units, are part of the schema."""
    assert "I_L held over [k T_s, (k+1) T_s) [A]" in schema_text("dcmg_msgs/msg/State")


@pytest.mark.parametrize(
    ("type_name", "expected"),
    [
        ("std_msgs/msg/Header", "RIHS01_f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01"),
        (
            "diagnostic_msgs/msg/DiagnosticArray",
            "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
        ),
    ],
)
def test_hashes_are_those_of_ros(type_name: str, expected: str) -> None:
    """The hash of a standard type is the one in the type's JSON description of ROS 2 Jazzy."""
    assert type_hash(type_name) == expected


def test_unknown_type_is_named() -> None:
    """A type that nobody defines is an error that names it."""
    with pytest.raises(BagError, match="'dcmg_msgs/msg/Nothing' is unknown"):
        schema_text("dcmg_msgs/msg/Nothing")
    with pytest.raises(BagError, match="'dcmg_msgs/msg/Nothing' is unknown"):
        type_hash("dcmg_msgs/msg/Nothing")
