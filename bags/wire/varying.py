"""What the codecs of messages of varying length share: rosbags' serialiser, the padding of RTPS, headers."""

from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar, cast

from bags.mcap.errors import BagError
from bags.mcap.typestore import typestore
from bags.wire.codecs import stamp_of

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_Record = TypeVar("_Record", bound="DataclassInstance")

# RTPS pads a payload to whole words on its way between processes: padded from the start it is the same everywhere
_RTPS_ALIGNMENT = 4


def header_of(step: int, period_ns: int, frame_id: str) -> object:
    """Header with the stamp of step k."""
    sec, nanosec = stamp_of(step, period_ns)
    stamp = new_message("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    return new_message("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)


def new_message(type_name: str, **fields: object) -> Any:  # noqa: ANN401 - rosbags makes its classes at run time
    """A message of a type, or a part of one."""
    return cast("Any", typestore().types[type_name])(**fields)


def serialize(type_name: str, **fields: object) -> bytes:
    """Bytes of a message on the wire."""
    data = bytes(typestore().serialize_cdr(new_message(type_name, **fields), type_name, little_endian=True))
    return data + bytes(-len(data) % _RTPS_ALIGNMENT)


def deserialize(type_name: str, data: bytes) -> Any:  # noqa: ANN401 - rosbags makes its classes at run time
    """The message in these bytes.

    Raises:
        BagError: They are no such message.
    """
    try:
        return typestore().deserialize_cdr(data, type_name)
    except Exception as error:  # rosbags raises whatever the damaged bytes lead to
        raise BagError(f"{type_name}: found {len(data)} bytes that cannot be decoded ({error})") from error


def fields_of(record: "DataclassInstance") -> dict[str, Any]:
    """The fields of a record that has those of its message."""
    return {one.name: getattr(record, one.name) for one in fields(record)}


def record_of(kind: type[_Record], message: object) -> _Record:
    """The record that has the fields of a message."""
    return kind(**{one.name: getattr(message, one.name) for one in fields(kind)})
