"""Validation errors in one line: key path, value found, what was expected."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from dgu_sim.suggestions import meant

__all__ = ["Problem", "explain", "listed", "part_of", "shown"]

Model = TypeVar("Model", bound=BaseModel)

_QUOTED = re.compile("'([^']*)'")

SHOWN = 60
"""Longer values are cut: a message stays one readable line."""

LISTED = 40
"""Longer lists are cut likewise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One thing that is wrong.

    Attributes:
        key: Path of the key from the root of the file; list indices count from 0.
        found: The value as the user wrote it, or None when the key is missing.
        expected: What was expected instead.
    """

    key: tuple[str | int, ...]
    found: str | None
    expected: str

    def __str__(self) -> str:
        """Return "key = value: what was expected"."""
        path = ".".join(str(part) for part in self.key)
        if self.found is None:
            return f"{path}: {self.expected}" if path else self.expected
        return f"{path} = {self.found}: {self.expected}" if path else f"{self.found}: {self.expected}"


def explain(error: ValidationError, data: object) -> Problem:
    """Return the first problem of a validation error.

    Args:
        error: What pydantic raised.
        data: What was validated: tells the keys of the file from pydantic's union tags.
    """
    first = error.errors(include_url=False)[0]
    context = first.get("ctx", {})
    kind = first["type"]
    location = _keys_only(tuple(first["loc"]), data, absent=kind == "missing")
    if kind == "finding":
        return Problem(key=location + context["key"], found=shown(context["value"]), expected=context["expected"])
    if kind == "problem":  # an explained error of a part that was validated on its own
        inner: Problem = context["problem"]
        return Problem(key=location + inner.key, found=inner.found, expected=inner.expected)
    if kind == "missing":
        return Problem(key=location, found=None, expected="this key is missing")
    if kind in {"union_tag_invalid", "union_tag_not_found"}:
        tag = context.get("tag")
        tags = context.get("expected_tags", "")
        expected = f"expected one of {tags}{_hint(tag, tags)}" if tags else "this key is missing"
        return Problem(key=(*location, "kind"), found=None if tag is None else shown(tag), expected=expected)
    expected = _expected(kind, first["msg"], context)
    if kind in {"literal_error", "enum"}:
        expected += _hint(first["input"], context["expected"])
    return Problem(key=location, found=shown(first["input"]), expected=expected)


def part_of(model: type[Model], given: Mapping[str, object]) -> Model:
    """Validate a part of something that is being validated; what is wrong in it is told with the key of the whole."""
    try:
        return model.model_validate(given)
    except ValidationError as error:
        problem = explain(error, given)
        raise PydanticCustomError("problem", "{problem}", {"problem": problem}) from None


def shown(value: object) -> str:
    """Return a value as it may stand in a message."""
    text = repr(value)
    return text if len(text) <= SHOWN else text[: SHOWN - 4] + " ..."


def listed(items: Sequence[object], most: int = LISTED) -> str:
    """Return what there is to choose from as it may stand in a message; of many, the first and the last."""
    if len(items) <= most:
        return ", ".join(map(str, items))
    return f"{', '.join(map(str, items[: most - 1]))} ... {items[-1]} ({len(items)} in all)"


def _hint(word: object, listed: str) -> str:
    """Name the nearest of the names that pydantic lists between quotes."""
    near = meant(word, _QUOTED.findall(listed)) if isinstance(word, str) else ""
    return f"; {near}" if near else ""


def _expected(kind: str, message: str, context: Mapping[str, object]) -> str:
    """Turn pydantic's "Input should be ..." into "expected ..." in the words of a YAML file."""
    if kind in {"tuple_type", "list_type"}:
        return "expected a list"
    if kind in {"model_type", "dict_type", "model_attributes_type"}:
        return "expected a mapping of keys to values"
    if kind == "too_short":
        return f"expected at least {context['min_length']} entries"
    text = message.partition(", unable to parse")[0]
    for words in ("greater", "less"):
        text = text.replace(f"Input should be {words}", f"expected a number {words}", 1)
    text = text.replace("Input should be", "expected", 1)
    return text[:1].lower() + text[1:]


def _keys_only(location: tuple[str | int, ...], data: object, *, absent: bool) -> tuple[str | int, ...]:
    """Drop the union tags that pydantic puts between the keys of the file; keep a last key that is absent."""
    keys: list[str | int] = []
    for position, part in enumerate(location):
        inside = (isinstance(data, dict) and part in data) or (
            isinstance(data, list | tuple) and isinstance(part, int) and part < len(data)
        )
        if inside:
            keys.append(part)
            data = data[part]  # type: ignore[index]  # just checked
        elif absent and position == len(location) - 1:
            keys.append(part)
    return tuple(keys)
