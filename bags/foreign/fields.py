"""Field paths: which number of which message, as in `/plant/state.position[0]`."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

import numpy as np
from rosbags.interfaces import Nodetype

from bags.mcap.errors import BagError

# fields of each message type by name, as rosbags keeps them: (name, (node type, description)) each
Definitions: TypeAlias = Mapping[str, Sequence[tuple[str, Any]]]

_TOPIC = re.compile(r"/?[^\s.\[\]]+")
_KEY = re.compile(r"\.([A-Za-z]\w*)|\[(\d+)\]")
_WHOLE = 2.0**53  # whole numbers beyond it may have no double of their own
_NUMBERS = frozenset(
    ["bool", "byte", "char", "octet", "float32", "float64"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldPath:
    """One number in the messages of a topic.

    Attributes:
        topic: ROS topic name.
        keys: Names of fields and indices of arrays, from the outside in.
    """

    topic: str
    keys: tuple[str | int, ...]

    @classmethod
    def parse(cls, text: str, topics: Iterable[str] = ()) -> "FieldPath":
        """From `/topic.field.inner[0]`.

        Args:
            text: As it is written.
            topics: Known topics, whose names may hold anything, dots among them; the longest that fits counts.

        Raises:
            BagError: It is written in another way.
        """
        known = max((one for one in topics if text.strip().startswith(f"{one}.")), key=len, default=None)
        topic, dot, rest = (
            text.strip().partition(".") if known is None else (known, ".", text.strip()[len(known) + 1 :])
        )
        keys: list[str | int] = []
        at = 0
        rest = dot + rest
        while match := _KEY.match(rest, at):
            keys.append(match[1] or int(match[2]))
            at = match.end()
        if (known is None and not _TOPIC.fullmatch(topic)) or not keys or at != len(rest):
            raise BagError(f"field {text!r}: expected a topic and a field, as in /plant/state.position[0]")
        return cls(topic=topic, keys=tuple(keys))

    def __str__(self) -> str:
        """As it is written."""
        return self.topic + "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in self.keys)

    def check(self, type_name: str, definitions: Definitions) -> None:
        """Follow the path through the definitions of the topic's type.

        Args:
            type_name: Full name, `package/msg/Type`.
            definitions: Fields of this type and of all that it uses.

        Raises:
            BagError: The type is unknown, a field is missing, an index is needed, too much or out of range, or what is
                found is no number.
        """
        kind, detail = Nodetype.NAME, cast("Any", type_name)
        for depth, key in enumerate(self.keys):
            kind, detail = self._inside(depth, key, kind, detail, definitions)
        if kind is not Nodetype.BASE or detail[0] not in _NUMBERS:
            hint = ""
            if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
                hint = f", as in {self}[0]"
            elif kind is Nodetype.NAME and detail in definitions:
                hint = f": one of its fields {_names(definitions, detail)}"
            raise BagError(f"field {self}: is {_described(kind, detail)}, expected a number{hint}")

    def read(self, message: object) -> float:
        """The number in one message.

        Raises:
            BagError: An array of varying length is too short in this message, or a whole number has no double.
        """
        found: Any = message
        for key in self.keys:
            if isinstance(key, int):
                if key >= len(found):
                    raise BagError(f"field {self}: index {key} is out of range, the message has {len(found)} elements")
                found = found[key]
            else:
                found = getattr(found, key)
        # rclpy gives single bytes as bytes objects
        number = float(found[0] if isinstance(found, bytes) else found)
        if abs(number) >= _WHOLE and isinstance(found, (int, np.integer)) and int(found) != int(number):
            raise BagError(f"field {self}: {found} has more digits than a double, expected a number up to 2**53")
        return number

    def _inside(
        self,
        depth: int,
        key: str | int,
        kind: Nodetype,
        detail: Any,  # noqa: ANN401 - of rosbags
        definitions: Definitions,
    ) -> tuple[Nodetype, Any]:
        so_far = FieldPath(topic=self.topic, keys=self.keys[:depth])
        if isinstance(key, int):
            if kind not in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
                raise BagError(f"field {self}: {so_far} is {_described(kind, detail)}, expected no index behind it")
            element, length = detail
            if kind is Nodetype.ARRAY and key >= length:
                raise BagError(f"field {self}: index {key} is out of range, {so_far} has {length} elements")
            return element[0], element[1]
        if kind is not Nodetype.NAME:
            raise BagError(f"field {self}: {so_far} is {_described(kind, detail)}, expected no field {key!r} in it")
        if detail not in definitions:
            raise BagError(
                f"field {self}: message type {detail} of {so_far} is unknown: it is neither of ROS 2 Jazzy nor "
                "defined with the data"
            )
        fields = dict(definitions[detail])
        if key not in fields:
            raise BagError(
                f"field {self}: {detail} has no field {key!r}, expected one of {_names(definitions, detail)}"
            )
        found = fields[key]
        return found[0], found[1]


def numeric_fields(type_name: str, definitions: Definitions, prefix: str = "", depth: int = 4) -> list[str]:
    """Paths of the numbers in a message type, arrays as `data[*]` or `covariance[0..8]`; without headers.

    Args:
        type_name: Full name.
        definitions: Fields of each type.
        prefix: Path so far.
        depth: How deep messages inside messages are followed.
    """
    found: list[str] = []
    for name, field in definitions.get(type_name, ()):
        path, range_text = f"{prefix}.{name}", ""
        kind, detail = field
        if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
            (kind, detail), length = detail
            range_text = f"[0..{length - 1}]" if length else "[*]"
        if kind is Nodetype.NAME and detail == "std_msgs/msg/Header":
            continue
        if kind is Nodetype.NAME and depth:
            found += numeric_fields(detail, definitions, path + range_text, depth - 1)
        elif kind is Nodetype.BASE and detail[0] in _NUMBERS:
            found.append(path + range_text)
    return found


def _names(definitions: Definitions, type_name: str) -> str:
    return ", ".join(name for name, _ in definitions[type_name])


def _described(kind: Nodetype, detail: Any) -> str:  # noqa: ANN401 - of rosbags
    if kind is Nodetype.BASE:
        return f"a {detail[0]}"
    if kind is Nodetype.NAME:
        return f"a message {detail}"
    return f"an array of {_described(*detail[0]).split(' ', 1)[1]}"
