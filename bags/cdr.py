"""Fixed-length messages as bytes: the CDR encoding of ROS 2, derived from the field definitions.

A message is 4 bytes of encapsulation (`00 01 00 00`: plain CDR, little endian) and its fields in order, each aligned
to its own size counted from behind the encapsulation. Every length of ours is known once the one string (frame_id) is.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, cast, final

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from bags.errors import BagError
from bags.typestore import typestore

ENCAPSULATION = b"\x00\x01\x00\x00"

# primitive type -> struct code, numpy code, size (= CDR alignment) in bytes
_PRIMITIVES = {
    "bool": ("?", "?", 1),
    "byte": ("B", "u1", 1),
    "char": ("B", "u1", 1),
    "int8": ("b", "i1", 1),
    "uint8": ("B", "u1", 1),
    "int16": ("h", "<i2", 2),
    "uint16": ("H", "<u2", 2),
    "int32": ("i", "<i4", 4),
    "uint32": ("I", "<u4", 4),
    "int64": ("q", "<i8", 8),
    "uint64": ("Q", "<u8", 8),
    "float32": ("f", "<f4", 4),
    "float64": ("d", "<f8", 8),
}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Where every field of one fixed-length message lies.

    Attributes:
        type_name: Full message type name.
        text: Value of the one string field, "" when there is none.
        names: Dotted names of the fields that `pack` takes and `unpack` gives, in order; an array counts once.
        dtype: The whole message, encapsulation included, as a numpy record with the dotted names as fields; the
            string's length and bytes are `<name>.length` and `<name>`, the encapsulation is `encapsulation`.
    """

    type_name: str
    text: str
    names: tuple[str, ...]
    dtype: np.dtype[np.void]
    _codec: struct.Struct = field(repr=False)
    _text_bytes: bytes = field(repr=False)
    _text_at: int = field(repr=False)

    @property
    def size(self) -> int:
        """Length of the message in bytes."""
        return self._codec.size

    def pack(self, *values: object) -> bytes:
        """Bytes on the wire.

        Args:
            values: One scalar for each field in definition order, the string left out, arrays element by element.
        """
        at = self._text_at
        return self._codec.pack(ENCAPSULATION, *values[:at], self._text_bytes, *values[at:])

    def unpack(self, data: bytes) -> tuple[Any, ...]:
        """The values that `pack` takes.

        Raises:
            BagError: The message has another length or encoding.
        """
        if len(data) != self._codec.size or not data.startswith(ENCAPSULATION):
            raise BagError(
                f"{self.type_name}: found {len(data)} bytes starting with {data[:4].hex(' ')}, "
                f"expected {self.size} starting with {ENCAPSULATION.hex(' ')}"
            )
        values = self._codec.unpack(data)
        at = self._text_at + 1
        return values[1:at] + values[at + 1 :]

    def template(self, count: int) -> NDArray[np.void]:
        """A block of messages with the constant parts filled in and everything else zero, shape (count,)."""
        zeros = (0,) * (self._codec_values() - 2)
        return np.frombuffer(bytearray(self.pack(*zeros) * count), dtype=self.dtype)

    def _codec_values(self) -> int:
        return len(self._codec.unpack(bytes(self._codec.size)))


def layout_of(type_name: str, text: str = "") -> Layout:
    """Layout of a message type whose one string field, if any, always holds `text`.

    Args:
        type_name: Full message type name.
        text: The string, usually the header's frame_id.

    Raises:
        BagError: The type has a sequence, or more than one string: its length is not fixed.
    """
    encoded = text.encode() + b"\0"
    builder = _Builder()
    for name, primitive, count in _leaves(type_name, ""):
        if primitive == "string":
            builder.add_text(name, encoded)
        else:
            builder.add(name, primitive, count)
    if len(builder.texts) > 1:
        raise BagError(f"{type_name}: found the strings {', '.join(builder.texts)}, expected at most one")
    spec = {"names": builder.names, "formats": builder.formats, "offsets": builder.offsets, "itemsize": builder.end}
    text_bytes = struct.pack("<I", len(encoded)) + encoded if builder.texts else b""
    return Layout(
        type_name=type_name,
        text=text if builder.texts else "",
        names=tuple(builder.packed),
        # numpy's stubs know this dictionary form only as an unnamed protocol
        dtype=cast("np.dtype[np.void]", np.dtype(spec)),  # type: ignore[call-overload]
        _codec=struct.Struct(builder.code if builder.texts else builder.code + "0s"),
        _text_bytes=text_bytes,
        _text_at=builder.text_at if builder.texts else builder.values,
    )


class _Builder:
    """Collects struct format and numpy fields while walking a message definition."""

    def __init__(self) -> None:
        self.code = "<4s"
        self.end = len(ENCAPSULATION)
        self.values = 0
        self.text_at = 0
        self.texts: list[str] = []
        self.packed: list[str] = []
        self.names = ["encapsulation"]
        self.formats: list[object] = ["V4"]
        self.offsets = [0]

    def add(self, name: str, primitive: str, count: int) -> None:
        """Append one number or fixed array."""
        letter, numpy_code, size = _PRIMITIVES[primitive]
        self._align(size)
        self._field(name, numpy_code if count == 0 else (numpy_code, (count,)))
        self.code += letter * max(count, 1)
        self.end += size * max(count, 1)
        self.values += max(count, 1)
        self.packed.append(name)

    def add_text(self, name: str, encoded: bytes) -> None:
        """Append a string: its length, then its bytes with the closing zero."""
        self._align(4)
        self.texts.append(name)
        self.text_at = self.values
        self._field(f"{name}.length", "<u4")
        self.offsets.append(self.end + 4)
        self.names.append(name)
        self.formats.append(f"S{len(encoded)}")
        self.code += f"{4 + len(encoded)}s"
        self.end += 4 + len(encoded)

    def _align(self, size: int) -> None:
        padding = -(self.end - len(ENCAPSULATION)) % size
        self.code += "x" * padding
        self.end += padding

    def _field(self, name: str, code: object) -> None:
        self.names.append(name)
        self.formats.append(code)
        self.offsets.append(self.end)


def _leaves(type_name: str, prefix: str) -> Iterator[tuple[str, str, int]]:
    """Dotted name, primitive type and array length (0: a scalar) of every field, nested messages opened up."""
    store = typestore()
    if type_name not in store.fielddefs:
        raise BagError(f"message type {type_name!r} is unknown")
    for name, (kind, detail) in store.fielddefs[type_name][1]:
        dotted = prefix + name
        match kind, detail:
            case Nodetype.BASE, (str(primitive), _):
                yield dotted, primitive, 0
            case Nodetype.NAME, str(nested):
                yield from _leaves(nested, f"{dotted}.")
            case Nodetype.ARRAY, ((Nodetype.BASE, (str(primitive), _)), int(count)) if primitive != "string":
                yield dotted, primitive, count
            case _:
                raise BagError(f"{type_name}: field {dotted} has no fixed length, expected numbers and fixed arrays")
