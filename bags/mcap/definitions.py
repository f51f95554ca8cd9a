"""Messages by the definition that their own channel carries: one type name may stand for two definitions in one bag."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeAlias

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype

from bags.mcap.errors import BagError
from bags.mcap.typestore import PACKAGE, SCHEMA_SEPARATOR, Definitions, typestore

# fields of message types by name, as rosbags keeps them: (constants, [(field, (node type, description))])
Types: TypeAlias = Mapping[str, tuple[Any, Sequence[tuple[str, Any]]]]

_IDL = ("ros2idl", "omgidl")
_MSG = ("ros2msg", "ros1msg")
ROS1 = "ros1"
CDR = "cdr"


@dataclass(frozen=True, slots=True, kw_only=True)
class Definition:
    """What a channel says about its messages.

    Attributes:
        type_name: Full message type name.
        form: How the text is written: ros2msg, ros2idl, ros1msg, or "" when there is none.
        text: The definition, with those of the types inside it.
        encoding: Of the messages: cdr or ros1; others cannot be read.
        type_hash: RIHS01 hash of the type, "" when nothing says it.
    """

    type_name: str
    form: str = ""
    text: str = field(default="", repr=False)
    encoding: str = CDR
    type_hash: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoder:
    """Reads the messages of one definition.

    Attributes:
        type_name: Full message type name.
        fields: Fields of the type and of all types inside it, by name.
        read: From the bytes of a message to an object with its fields as attributes; raises BagError.
    """

    type_name: str
    fields: Mapping[str, Sequence[tuple[str, Any]]] = field(repr=False)
    read: Callable[[bytes], Any] = field(repr=False)


def decoder_of(definition: Definition, others: "Types | None" = None) -> Decoder:
    """What reads the messages of a definition.

    Args:
        definition: Of a channel. Without a text of its own the type is looked up in `others`, then in ROS 2 Jazzy.
        others: Definitions from elsewhere: `--definitions`, installed packages.

    Raises:
        BagError: The encoding or the definition cannot be read, or nobody defines the type.
    """
    if definition.encoding not in {CDR, ROS1}:
        raise BagError(f"its messages are encoded as {definition.encoding or 'nothing'!r}, expected {CDR}")
    types, store = _of_itself(definition) if not others else _with_store(definition, others)
    if not definition.text:
        _check_hash(definition, store.hash_rihs01)
    return _decoder(definition, types, store)


def hash_of(definition: Definition) -> str:
    """RIHS01 hash of a type as a definition has it.

    Raises:
        BagError: The definition cannot be read.
    """
    return str(_of_itself(definition)[1].hash_rihs01(definition.type_name))


@lru_cache(maxsize=1000)
def _of_itself(definition: Definition) -> tuple[Mapping[str, Any], Any]:
    return _with_store(definition, {})


def _with_store(definition: Definition, others: Types) -> tuple[Mapping[str, Any], Any]:
    types = _types(definition, others)
    return types, _store(definition, types)


def _store(definition: Definition, types: Mapping[str, Any]) -> Any:  # noqa: ANN401 - of rosbags
    try:
        store = get_typestore(Stores.EMPTY)
        store.register(dict(types))
        store.get_msgdef(definition.type_name)
    except Exception as error:  # rosbags raises whatever a definition leads to
        raise BagError(f"its definition of {definition.type_name} cannot be used ({_reason(error)})") from error
    return store


def types_in(definition: Definition) -> dict[str, Any]:
    """The types that the text of a definition defines.

    Raises:
        BagError: It cannot be parsed, or does not define the type.
    """
    try:
        return dict(_parsed(definition.type_name, definition.form, definition.text))
    except BagError:
        raise
    except Exception as error:  # idem
        raise BagError(f"its definition of {definition.type_name} cannot be parsed ({_reason(error)})") from error


def is_standard(definition: Definition) -> bool:
    """Whether messages of a definition are laid out as our own type store, ROS 2 Jazzy and dcmg_msgs, says."""
    known = typestore().fielddefs
    if definition.encoding != CDR or definition.type_name not in known:
        return False
    if not definition.text:
        return not definition.type_hash or definition.type_hash == typestore().hash_rihs01(definition.type_name)
    try:
        types = types_in(definition)
    except BagError:
        return False
    return all(name in known and _shape(fields) == _shape(known[name][1]) for name, (_, fields) in types.items())


def differing(found: Iterable[Definition]) -> Definitions:
    """Those of our own types that a bag lays out otherwise than we do: it is older, or newer."""
    ours = sorted(
        {
            (one.type_name, one.text)
            for one in set(found)
            if one.type_name.startswith(f"{PACKAGE}/") and not is_standard(one)
        }
    )
    return tuple(ours)


def types_in_folder(folder: Path) -> dict[str, Any]:
    """Every `*.msg` below a folder, as `PACKAGE/msg/NAME.msg` or `PACKAGE/NAME.msg`.

    Raises:
        BagError: There is none, or one cannot be parsed.
    """
    if not folder.is_dir():
        raise BagError(f"{folder}: is no folder, expected one with .msg files")
    found: dict[str, Any] = {}
    for file in sorted(folder.resolve().rglob("*.msg")):
        package = file.parent.parent.name if file.parent.name == "msg" else file.parent.name
        name = f"{package}/msg/{file.stem}"
        try:
            found |= get_types_from_msg(file.read_text("utf-8"), name)
        except Exception as error:  # rosbags raises whatever a definition leads to
            raise BagError(f"{file}: is no message definition ({_reason(error)})") from error
    if not found:
        raise BagError(f"{folder}: holds no .msg file, expected PACKAGE/msg/NAME.msg below it")
    return found


def installed_definition(type_name: str, folders: Sequence[Path]) -> dict[str, Any]:
    """A type as an installed ROS package defines it, with the types inside it as far as they are installed.

    Args:
        type_name: Full message type name.
        folders: Prefixes, as in AMENT_PREFIX_PATH.
    """
    found: dict[str, Any] = {}
    wanted = [type_name]
    while wanted:
        name = wanted.pop()
        package, _, base = name.partition("/msg/")
        places = (one / "share" / package / "msg" / f"{base}.msg" for one in folders)
        file = next((one for one in places if base and one.is_file()), None)
        if name in found or file is None:
            continue
        try:
            found |= get_types_from_msg(file.read_text("utf-8"), name)
        except Exception:  # noqa: BLE001, S112 - as good as not installed
            continue
        wanted += [inner for inner in _inside(found[name][1]) if inner not in found]
    return found


def _types(definition: Definition, others: Types) -> dict[str, Any]:
    """The type and everything inside it: from its own text first, then from elsewhere, then from Jazzy."""
    own = types_in(definition) if definition.text else {}
    found: dict[str, Any] = {}
    wanted = [definition.type_name]
    while wanted:
        name = wanted.pop()
        if name in found:
            continue
        place = next((one for one in (own, others, typestore().fielddefs) if name in one), None)
        if place is None:
            if not name:
                raise BagError(
                    "nothing says of which type its messages are: it has no schema, and metadata.yaml knows none"
                )
            raise BagError(
                f"message type {name} is unknown: neither the recording, nor ROS 2 Jazzy, nor an installed package "
                "defines it; --definitions DIR takes a folder of .msg files"
            )
        found[name] = place[name]
        wanted += _inside(place[name][1])
    return found


def _inside(fields: Sequence[tuple[str, Any]]) -> list[str]:
    """Names of the message types that fields are of."""
    found = []
    for _, (kind, detail) in fields:
        element = detail[0] if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE} else (kind, detail)
        if element[0] is Nodetype.NAME:
            found.append(str(element[1]))
    return found


def _shape(fields: Sequence[tuple[str, Any]]) -> list[Any]:
    """Names and types, without what differs only in the way it is written."""
    return [(name, tuple(detail) if isinstance(detail, list) else detail) for name, (_, detail) in fields]


@cache
def _parsed(type_name: str, form: str, text: str) -> dict[str, Any]:
    if form in _MSG:
        found: dict[str, Any] = dict(get_types_from_msg(text, type_name))
    elif form in _IDL:
        found = {}
        for part in _idl_parts(text):
            found |= get_types_from_idl(part)
    else:
        raise BagError(f"its definition is written as {form!r}, expected ros2msg or ros2idl")
    if normalize_msgtype(type_name) not in found:
        raise BagError(f"its definition does not define {type_name}")
    return found


def _idl_parts(text: str) -> Iterator[str]:
    head = f"{SCHEMA_SEPARATOR}\nIDL: "
    if not text.startswith(head):
        yield text
        return
    for part in text.split(head)[1:]:
        yield part.partition("\n")[2]


def _check_hash(definition: Definition, hash_of: Callable[[str], str]) -> None:
    """A type that is looked up elsewhere must be the one that was recorded, where the recording says which."""
    if definition.type_hash.startswith("RIHS01_") and hash_of(definition.type_name) != definition.type_hash:
        raise BagError(
            f"message type {definition.type_name} was recorded with another definition than the one known here (type "
            "hash): --definitions DIR takes a folder of its .msg files"
        )


def _decoder(definition: Definition, types: Mapping[str, Any], store: Any) -> Decoder:  # noqa: ANN401 - of rosbags
    name = definition.type_name
    deserialize = store.deserialize_ros1 if definition.encoding == ROS1 else store.deserialize_cdr

    def read(data: bytes) -> Any:  # noqa: ANN401 - a class that rosbags makes
        try:
            return deserialize(data, name)
        except Exception as error:  # idem: whatever the bytes lead to
            raise BagError(f"a message of {len(data)} bytes is no {name} ({_reason(error)})") from error

    return Decoder(type_name=name, fields={one: fields for one, (_, fields) in types.items()}, read=read)


def _reason(error: Exception) -> str:
    return f"{' '.join(str(error).split()) or type(error).__name__:.160}"
