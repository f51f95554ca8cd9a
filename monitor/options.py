"""Turn the options of a scenario (a mapping) into frozen data, with one line when they do not fit."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from pydantic import TypeAdapter, ValidationError

from monitor.errors import MonitorError

if TYPE_CHECKING:
    from collections.abc import Mapping

Options = TypeVar("Options")


def parse_options(kind: type[Options], options: Mapping[str, object], owner: str) -> Options:
    """Validate options against a frozen pydantic dataclass.

    Raises:
        MonitorError: names the owner, the key, the value and what was expected.
    """
    try:
        return TypeAdapter(kind).validate_python(dict(options))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise MonitorError(f"{owner}: option {key} = {first['input']!r}: {first['msg']}") from None
