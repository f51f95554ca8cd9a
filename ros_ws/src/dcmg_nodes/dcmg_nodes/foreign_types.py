"""Message types by name, whoever defined them, and what is in them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from rosbags.interfaces import Nodetype

from dcmg_nodes.errors import NodeError
from dcmg_nodes.ports import message_class

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_ARRAY = re.compile(r"(?:sequence<(?P<bounded>[^,>]+(?:<\d+>)?)(?:, *\d+)?>|(?P<element>.+)\[(?P<length>\d+)\])")
_PLACEHOLDER = "structure_needs_at_least_one_member"  # of types without fields
_BYTES = {"char": "uint8", "byte": "uint8", "octet": "uint8"}
_NAMES = {"float": "float32", "double": "float64", "boolean": "bool", "octet": "byte"}


def foreign_class(type_name: str, topic: str) -> Any:  # noqa: ANN401 (generated message classes share no base)
    """Return the generated class of a message type.

    Raises:
        NodeError: its package is not installed here.
    """
    try:
        return message_class(type_name)
    except (ImportError, AttributeError, ValueError):
        raise NodeError(
            f"topic {topic}: message type {type_name} is unknown here, expected its package to be installed or sourced"
        ) from None


def definitions_of_class(type_name: str) -> Mapping[str, Sequence[tuple[str, Any]]]:
    """Return the fields of a message type and of all types inside it, as `bags.foreign.fields` follows them."""
    found: dict[str, list[tuple[str, Any]]] = {}
    wanted = [type_name]
    while wanted:
        name = wanted.pop()
        if name in found:
            continue
        fields = message_class(name).get_fields_and_field_types()
        found[name] = [(field, _described(text)) for field, text in fields.items()]
        wanted += [
            detail for _, (kind, (detail, *_)) in _inner(found[name]) if kind is Nodetype.NAME and detail not in found
        ]
    return found


def differing_type(type_name: str, recorded: Mapping[str, Sequence[tuple[str, Any]]]) -> str | None:
    """Return which type inside a message type has other fields than the one that is installed, if any has.

    Args:
        type_name: full name of an installed type.
        recorded: fields of this type and of all types inside it as a bag has them.
    """
    installed = definitions_of_class(type_name)
    return next((name for name, fields in installed.items() if _plain(fields) != _plain(recorded.get(name, ()))), None)


def _plain(fields: Sequence[tuple[str, Any]]) -> list[tuple[str, Any]]:
    """Return fields as they lie in the bytes: strings and sequences without bounds, one name for each base type."""
    return [(name, _plain_type(described)) for name, described in fields if name != _PLACEHOLDER]


def _plain_type(described: tuple[Nodetype, Any]) -> tuple[Any, ...]:
    kind, detail = described
    if kind is Nodetype.BASE:
        return kind, _BYTES.get(detail[0], detail[0])
    if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
        return kind, _plain_type(detail[0]), detail[1] if kind is Nodetype.ARRAY else 0
    return kind, detail


def _inner(fields: Sequence[tuple[str, Any]]) -> list[tuple[str, tuple[Nodetype, tuple[str, ...]]]]:
    """Return each field with the type of its elements."""
    found = []
    for name, (kind, detail) in fields:
        element = detail[0] if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE} else (kind, detail)
        found.append((name, (element[0], element[1] if isinstance(element[1], tuple) else (element[1],))))
    return found


def _described(text: str) -> tuple[Nodetype, Any]:
    """Return what rosbags would say of a field whose type rosidl writes as `text`."""
    match = _ARRAY.fullmatch(text)
    if match is not None:
        length = int(match["length"] or 0)
        return (Nodetype.ARRAY if length else Nodetype.SEQUENCE), (
            _described(match["element"] or match["bounded"]),
            length,
        )
    if "/" in text:
        package, name = text.split("/")
        return Nodetype.NAME, f"{package}/msg/{name}"
    base = text.partition("<")[0]
    return Nodetype.BASE, (_NAMES.get(base, base), 0)
