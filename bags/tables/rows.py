"""Messages that vary in length as rows: nested messages become columns with dots, sequences lists."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from rosbags.interfaces import Nodetype

from bags.mcap.bag import Bag
from bags.mcap.definitions import Decoder, Definition, decoder_of
from bags.mcap.errors import BagError
from bags.mcap.typestore import typestore

_MOST_COLUMNS = 100  # of one array
Fields = Mapping[str, Sequence[tuple[str, Any]]]


def is_known(type_name: str) -> bool:
    """Whether messages of a type can be decoded."""
    return type_name in typestore().fielddefs


def standard_decoder(type_name: str) -> Decoder:
    """What reads messages of a type of ROS 2 Jazzy or of ours.

    Raises:
        BagError: The type is unknown.
    """
    return decoder_of(Definition(type_name=type_name))


def rows(bag: Bag, topic: str) -> Iterator[dict[str, Any]]:
    """Every message of a topic as plain values by column, `time_ns` first.

    Args:
        bag: The bag.
        topic: ROS topic name; its type must be one of ours or of ROS 2 Jazzy.

    Raises:
        BagError: No such topic, an unknown type, a message that is none, or a damaged bag.
    """
    decoder = standard_decoder(bag.type_of(topic))
    taken = flattener(decoder)
    for time_ns, data in bag.messages(topic):
        try:
            yield {"time_ns": time_ns, **taken(decoder.read(data))}
        except BagError as error:
            raise BagError(f"{bag.path}: {topic} holds a message that is no {decoder.type_name} ({error})") from error


def flattener(decoder: Decoder) -> Callable[[Any], dict[str, Any]]:
    """What turns a message of a type into plain values by column."""
    leaves = tuple(
        (".".join(path), path, _length(kind, detail))
        for path, kind, detail in _leaves(decoder.type_name, (), decoder.fields)
    )

    def flatten(message: object) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name, path, length in leaves:
            value = plain(_at(message, path), decoder.fields)
            if length:
                found |= {f"{name}[{place}]": one for place, one in enumerate(value)}
            else:
                found[name] = value
        return found

    return flatten


def kinds(decoder: Decoder) -> dict[str, tuple[str, ...]]:
    """Columns of a type: the primitive type, preceded by "list" for a sequence or array; ("struct",) otherwise."""
    found: dict[str, tuple[str, ...]] = {}
    for path, kind, detail in _leaves(decoder.type_name, (), decoder.fields):
        name, length = ".".join(path), _length(kind, detail)
        if length:
            found |= {f"{name}[{place}]": (str(detail[0][1][0]),) for place in range(length)}
        elif kind is Nodetype.BASE:
            found[name] = (str(detail[0]),)
        elif detail[0][0] is Nodetype.BASE:
            found[name] = ("list", str(detail[0][1][0]))
        else:
            found[name] = ("struct",)
    return found


def plain(value: object, fields: Fields) -> Any:  # noqa: ANN401 - numbers, texts, lists and dictionaries
    """A field's value without classes of any library."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, list):
        return [plain(one, fields) for one in value]
    type_name = getattr(value, "__msgtype__", None)
    if type_name is not None:  # the definition knows fields from constants
        return {name: plain(getattr(value, name), fields) for name, _ in fields[type_name]}
    return value


def _length(kind: Nodetype, detail: Any) -> int:  # noqa: ANN401 - of rosbags
    """Elements of an array that become a column each, 0 for everything else."""
    if kind is not Nodetype.ARRAY or detail[0][0] is not Nodetype.BASE or detail[1] > _MOST_COLUMNS:
        return 0
    return int(detail[1])


def _at(message: object, path: tuple[str, ...]) -> object:
    for name in path:
        message = getattr(message, name)
    return message


def _leaves(type_name: str, path: tuple[str, ...], fields: Fields) -> Iterator[tuple[tuple[str, ...], Nodetype, Any]]:
    for name, (kind, detail) in fields[type_name]:
        if kind is Nodetype.NAME:
            yield from _leaves(str(detail), (*path, name), fields)
        else:
            yield (*path, name), kind, detail
