"""Fixed-length messages as bytes: the CDR encoding of ROS 2, derived from the field definitions.

A message is 4 bytes of encapsulation (`00 01 00 00`: plain CDR, little endian) and its fields in order, each aligned
to its own size counted from behind the encapsulation. Every length of ours is known once the one string (frame_id) is,
and for a few messages how many elements their sequences have.
"""

import re
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from bags.mcap.errors import BagError
from bags.mcap.typestore import Definitions, typestore_of

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Where every field of one fixed-length message lies.

    Attributes:
        type_name: Full message type name.
        text: Value of the one string field, "" when there is none.
        names: Dotted names of the fields that `pack` takes and `unpack` gives, in order; an array counts once.
        dtype: The whole message, encapsulation included, as a numpy record with the dotted names as fields; the
            string's length and bytes are `<name>.length` and `<name>`, the encapsulation is `encapsulation`.
        pack: From one number for each field in definition order, the string left out and arrays element by element,
            to the bytes on the wire.
        unpack: From the bytes on the wire to the numbers that `pack` takes; raises BagError when the message has
            another length or encoding.
    """

    type_name: str
    text: str
    names: tuple[str, ...]
    dtype: np.dtype[np.void]
    pack: Callable[..., bytes] = field(repr=False, compare=False)
    unpack: Callable[[bytes], tuple[Any, ...]] = field(repr=False, compare=False)
    _numbers: int = field(repr=False)

    @property
    def size(self) -> int:
        """Length of the message in bytes."""
        return self.dtype.itemsize

    def fits(self, messages: NDArray[np.void]) -> bool:
        """Whether messages of the right size also say so: encapsulation, and lengths of strings and sequences."""
        wanted = self.template(1)
        names = [name for name in self.dtype.names or () if name == "encapsulation" or name.endswith(".length")]
        return all(bool(np.all(messages[name] == wanted[name])) for name in names)

    def template(self, count: int) -> NDArray[np.void]:
        """A block of messages with the constant parts filled in and everything else zero, shape (count,)."""
        return np.frombuffer(bytearray(self.pack(*(0,) * self._numbers) * count), dtype=self.dtype)

    def read(self, payloads: Iterable[bytes]) -> NDArray[np.void]:
        """Messages as one array, those left out that have another length or encoding, shape (messages,)."""
        ours = [one for one in payloads if len(one) == self.size and one.startswith(ENCAPSULATION)]
        return np.frombuffer(b"".join(ours), dtype=self.dtype)


@cache
def layout_of(
    type_name: str, text: str = "", sequences: tuple[tuple[str, int], ...] = (), definitions: Definitions = ()
) -> Layout:
    """Layout of a message type whose one string field, if any, always holds `text`.

    Args:
        type_name: Full message type name.
        text: The string, usually the header's frame_id.
        sequences: Dotted name and number of elements of each sequence: the same in every message; a name that is no
            sequence is passed over.
        definitions: Of types that are not as ours: those of an older bag.

    Raises:
        BagError: The type has another sequence, or more than one string: its length is not fixed.
    """
    encoded = text.encode() + b"\0"
    builder = _Builder()
    lengths = dict(sequences)
    for name, primitive, count, sequence in _leaves(type_name, "", lengths, typestore_of(definitions)):
        if primitive == "string":
            builder.add_text(name, encoded)
            continue
        if sequence:
            builder.add_constant(f"{name}.length", struct.pack("<I", count), "<u4")
        builder.add(name, primitive, count)
    if len(builder.texts) > 1:
        raise BagError(f"{type_name}: found the strings {', '.join(builder.texts)}, expected at most one")
    spec = {"names": builder.names, "formats": builder.formats, "offsets": builder.offsets, "itemsize": builder.end}
    return Layout(
        type_name=type_name,
        text=text if builder.texts else "",
        names=tuple(builder.packed),
        # numpy's stubs know this dictionary form only as an unnamed protocol
        dtype=cast("np.dtype[np.void]", np.dtype(spec)),  # type: ignore[call-overload]
        pack=_packer(builder.code, builder.constants),
        unpack=_unpacker(type_name, builder.code),
        _numbers=builder.values,
    )


# These run for every message of every node: closures, because looking attributes up would double their time.
def _packer(code: str, constants: list[tuple[int, bytes]]) -> Callable[..., bytes]:
    pack = struct.Struct(code).pack
    if not constants:
        return partial(pack, ENCAPSULATION)
    if len(constants) == 1:
        ((at, text),) = constants

        def pack_with_text(*values: object) -> bytes:
            arguments = [ENCAPSULATION, *values]
            arguments.insert(at + 1, text)
            return pack(*arguments)

        return pack_with_text
    backwards = constants[::-1]

    def pack_with_constants(*values: object) -> bytes:
        arguments = [ENCAPSULATION, *values]
        for position, data in backwards:
            arguments.insert(position + 1, data)
        return pack(*arguments)

    return pack_with_constants


def _unpacker(type_name: str, code: str) -> Callable[[bytes], tuple[Any, ...]]:
    # the encapsulation, the string and the lengths of sequences are constant: skip their bytes
    codec = struct.Struct(re.sub(r"(\d+)s", r"\1x", code))
    unpack_values, size = codec.unpack, codec.size

    def unpack(data: bytes) -> tuple[Any, ...]:
        if len(data) != size or not data.startswith(ENCAPSULATION):
            raise BagError(
                f"{type_name}: found {len(data)} bytes starting with {data[:4].hex(' ')}, "
                f"expected {size} starting with {ENCAPSULATION.hex(' ')}"
            )
        return unpack_values(data)

    return unpack


class _Leaf(NamedTuple):
    """A field: dotted name, primitive type, number of elements (None: a scalar), and whether a message says it."""

    name: str
    primitive: str
    elements: int | None = None
    sequence: bool = False


class _Builder:
    """Collects struct format and numpy fields while walking a message definition."""

    def __init__(self) -> None:
        self.code = "<4s"
        self.end = len(ENCAPSULATION)
        self.values = 0
        self.constants: list[tuple[int, bytes]] = []  # before which value, and what
        self.texts: list[str] = []
        self.packed: list[str] = []
        self.names = ["encapsulation"]
        self.formats: list[object] = ["V4"]
        self.offsets = [0]

    def add(self, name: str, primitive: str, count: int | None) -> None:
        """Append one number (count None) or array; an empty one takes no room, not even to be aligned."""
        letter, numpy_code, size = _PRIMITIVES[primitive]
        elements = 1 if count is None else count
        if elements:
            self._align(size)
        self._field(name, numpy_code if count is None else (numpy_code, (count,)))
        self.code += letter * elements
        self.end += size * elements
        self.values += elements
        self.packed.append(name)

    def add_text(self, name: str, encoded: bytes) -> None:
        """Append a string: its length, then its bytes with the closing zero."""
        self._align(4)
        self.texts.append(name)
        self.constants.append((self.values, struct.pack("<I", len(encoded)) + encoded))
        self._field(f"{name}.length", "<u4")
        self.offsets.append(self.end + 4)
        self.names.append(name)
        self.formats.append(f"S{len(encoded)}")
        self.code += f"{4 + len(encoded)}s"
        self.end += 4 + len(encoded)

    def add_constant(self, name: str, data: bytes, code: str) -> None:
        """Append a number that is the same in every message, aligned to its size."""
        self._align(len(data))
        self.constants.append((self.values, data))
        self._field(name, code)
        self.code += f"{len(data)}s"
        self.end += len(data)

    def _align(self, size: int) -> None:
        padding = -(self.end - len(ENCAPSULATION)) % size
        self.code += "x" * padding
        self.end += padding

    def _field(self, name: str, code: object) -> None:
        self.names.append(name)
        self.formats.append(code)
        self.offsets.append(self.end)


def _leaves(type_name: str, prefix: str, lengths: Mapping[str, int], store: Typestore) -> Iterator[_Leaf]:
    """Every field, nested messages opened up."""
    if type_name not in store.fielddefs:
        raise BagError(f"message type {type_name!r} is unknown")
    for name, (kind, detail) in store.fielddefs[type_name][1]:
        dotted = prefix + name
        match kind, detail:
            case Nodetype.BASE, (str(primitive), _):
                yield _Leaf(dotted, primitive)
            case Nodetype.NAME, str(nested):
                yield from _leaves(nested, f"{dotted}.", lengths, store)
            case Nodetype.ARRAY, ((Nodetype.BASE, (str(primitive), _)), int(count)) if primitive != "string":
                yield _Leaf(dotted, primitive, count)
            case Nodetype.SEQUENCE, ((Nodetype.BASE, (str(primitive), _)), _) if dotted in lengths:
                yield _Leaf(dotted, primitive, lengths[dotted], sequence=True)
            case _:
                raise BagError(f"{type_name}: field {dotted} has no fixed length, expected numbers and fixed arrays")
