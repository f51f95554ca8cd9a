"""The message types of a run: definitions, schema texts and type hashes, read from the ROS message files.

`bags/mcap/msg` is the message folder of the ROS package `dcmg_msgs`, so wire format and bags cannot drift apart.
"""

from functools import cache
from importlib import resources
from typing import TypeAlias

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from bags.mcap.errors import BagError

PACKAGE = "dcmg_msgs"
SCHEMA_SEPARATOR = "=" * 80


@cache
def typestore() -> Typestore:
    """All standard types of ROS 2 Jazzy and our own, as `dcmg_msgs/msg/X`."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for type_name, text in _own_definitions().items():
        store.register(get_types_from_msg(text, type_name))
    return store


Definitions: TypeAlias = tuple[tuple[str, str], ...]
"""Type names and schema texts of those of our types that a bag defines otherwise than we do."""


@cache
def typestore_of(definitions: Definitions) -> Typestore:
    """The types as a bag defines them.

    Raises:
        BagError: A definition cannot be read.
    """
    if not definitions:
        return typestore()
    store = get_typestore(Stores.ROS2_JAZZY)
    for type_name, text in {**_own_definitions(), **dict(definitions)}.items():
        try:
            store.register({type_name: get_types_from_msg(text, type_name)[type_name]})
        except Exception as error:  # rosbags raises whatever the text leads to
            raise BagError(f"{type_name}: its definition cannot be read ({error})") from error
    return store


@cache
def schema_text(type_name: str) -> str:
    """Definition of a type followed by those of all types it uses: the `ros2msg` schema of an MCAP channel.

    Our own definitions are given verbatim, so that the units in their comments travel with the data.

    Args:
        type_name: Full name, `package/msg/Type`.

    Raises:
        BagError: The type is unknown.
    """
    generated, _ = typestore().generate_msgdef(_known(type_name), ros_version=2)
    own = _own_definitions()
    first, *others = generated.split(f"{SCHEMA_SEPARATOR}\nMSG: ")
    parts = [own.get(type_name, first)]
    for part in others:
        short, _, body = part.partition("\n")
        package, _, base = short.partition("/")
        parts.append(f"{SCHEMA_SEPARATOR}\nMSG: {short}\n{own.get(f'{package}/msg/{base}', body)}")
    return "".join(parts)


@cache
def type_hash(type_name: str, definitions: Definitions = ()) -> str:
    """RIHS01 hash of a type, as ROS 2 puts it into `type_description_hash`.

    Args:
        type_name: Full name, `package/msg/Type`.
        definitions: Of types that are not as ours.

    Raises:
        BagError: The type is unknown.
    """
    return typestore_of(definitions).hash_rihs01(_known(type_name))


def _known(type_name: str) -> str:
    if type_name not in typestore().fielddefs:
        raise BagError(f"message type {type_name!r} is unknown, expected a type of ROS 2 Jazzy or of {PACKAGE}")
    return type_name


@cache
def _own_definitions() -> dict[str, str]:
    folder = resources.files("bags.mcap") / "msg"
    files = sorted((entry for entry in folder.iterdir() if entry.name.endswith(".msg")), key=lambda entry: entry.name)
    return {f"{PACKAGE}/msg/{file.name.removesuffix('.msg')}": file.read_text("utf-8") for file in files}
