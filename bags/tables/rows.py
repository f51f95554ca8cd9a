"""Messages that vary in length as rows: nested messages become columns with dots, sequences lists."""

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

from rosbags.interfaces import Nodetype

from bags.mcap.bag import Bag
from bags.mcap.errors import BagError
from bags.mcap.typestore import typestore


def is_known(type_name: str) -> bool:
    """Whether messages of a type can be decoded."""
    return type_name in typestore().fielddefs


def rows(bag: Bag, topic: str) -> Iterator[dict[str, Any]]:
    """Every message of a topic as plain values by column, `time_ns` first.

    Args:
        bag: The bag.
        topic: ROS topic name; its type must be one of ours or of ROS 2 Jazzy.

    Raises:
        BagError: No such topic, an unknown type, a message that is none, or a damaged bag.
    """
    type_name = bag.type_of(topic)
    taken = flattener(type_name)
    for time_ns, data in bag.messages(topic):
        try:
            message = typestore().deserialize_cdr(data, type_name)
        except Exception as error:  # rosbags raises whatever the damaged bytes lead to
            raise BagError(f"{bag.path}: {topic} holds a message that is no {type_name} ({error})") from error
        yield {"time_ns": time_ns, **taken(message)}


@cache
def flattener(type_name: str) -> Callable[[Any], dict[str, Any]]:
    """What turns a message of a type into plain values by column.

    Raises:
        BagError: The type is unknown.
    """
    leaves = tuple(_leaves(type_name, ()))

    def flatten(message: object) -> dict[str, Any]:
        return {".".join(path): plain(_at(message, path)) for path, _, _ in leaves}

    return flatten


@cache
def kinds(type_name: str) -> dict[str, tuple[str, ...]]:
    """Columns of a type: the primitive type, preceded by "list" for a sequence or array; ("struct",) otherwise.

    Raises:
        BagError: The type is unknown.
    """
    found: dict[str, tuple[str, ...]] = {}
    for path, kind, detail in _leaves(type_name, ()):
        if kind is Nodetype.BASE:
            found[".".join(path)] = (str(detail[0]),)
        elif detail[0][0] is Nodetype.BASE:
            found[".".join(path)] = ("list", str(detail[0][1][0]))
        else:
            found[".".join(path)] = ("struct",)
    return found


def plain(value: object) -> Any:  # noqa: ANN401 - numbers, texts, lists and dictionaries
    """A field's value without classes of any library."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, list):
        return [plain(one) for one in value]
    type_name = getattr(value, "__msgtype__", None)
    if type_name is not None:  # the definition knows fields from constants
        return {name: plain(getattr(value, name)) for name, _ in typestore().fielddefs[type_name][1]}
    return value


def _at(message: object, path: tuple[str, ...]) -> object:
    for name in path:
        message = getattr(message, name)
    return message


def _leaves(type_name: str, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Nodetype, Any]]:
    definitions = typestore().fielddefs
    if type_name not in definitions:
        raise BagError(f"message type {type_name!r} is unknown")
    for name, (kind, detail) in definitions[type_name][1]:
        if kind is Nodetype.NAME:
            yield from _leaves(str(detail), (*path, name))
        else:
            yield (*path, name), kind, detail
