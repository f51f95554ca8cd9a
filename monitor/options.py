"""Turn the options of a scenario (a mapping) into frozen data, with one line when they do not fit."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, TypeVar

from pydantic import ConfigDict, TypeAdapter, ValidationError

from monitor.errors import HistoryError, MonitorError, OptionError, PlugInError
from monitor.suggestions import meant

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

Kind = TypeVar("Kind")
Options = TypeVar("Options")

STRICT = ConfigDict(extra="forbid", defer_build=True)
"""Of every options class: no other keys; what checks them is built when it is first asked, for a run asks few."""

_UNKNOWN = {"unexpected_keyword_argument", "extra_forbidden"}


def parse_options(kind: type[Options], options: Mapping[str, object], owner: str) -> Options:
    """Validate options against a frozen pydantic dataclass.

    Raises:
        OptionError: names the owner, the key, the value and what was expected.
    """
    try:
        return TypeAdapter(kind).validate_python(dict(options))
    except ValidationError as error:
        first = error.errors()[0]
        key, value, expected = tuple(str(part) for part in first["loc"]), first["input"], first["msg"]
        if first["type"] == "finding":  # of `monitor.settings`
            key, value = (*key, *map(str, first["ctx"]["key"])), first["ctx"]["value"]
        if first["type"] in _UNKNOWN and len(key) == 1 and is_dataclass(kind):
            expected = f"no such option: {expected_one(key[0], [one.name for one in fields(kind)])}"
        raise wrong_option(owner, key, value, expected) from None


def wrong_option(owner: str, key: tuple[str, ...], value: object, expected: str) -> OptionError:
    """Return the error that an option has a value and something else was expected."""
    return OptionError(f"{owner}: option {'.'.join(key)} = {value!r}: {expected}", ("options", *key), value, expected)


def check_kind(what: str, kind: str, known: Collection[str]) -> None:
    """See that a name is a known one.

    Raises:
        OptionError: it is not.
    """
    if kind not in known:
        expected = expected_one(kind, sorted(known))
        raise OptionError(f"{what} kind is {kind!r}, {expected}", ("kind",), kind, expected)


def known_kind(what: str, kind: str, known: Mapping[str, Kind]) -> Kind:
    """Return the kind of a name.

    Raises:
        OptionError: there is none, or it is of a plug-in that cannot be used.
    """
    check_kind(what, kind, known)
    try:
        return known[kind]
    except PlugInError as error:
        raise OptionError(str(error), ("kind",), kind, str(error)) from error


def expected_one(found: str, known: Collection[str]) -> str:
    """Name what is known, with the one that is probably meant."""
    return f"expected one of {', '.join(known)}; {meant(found, known)}".removesuffix("; ")


@contextmanager
def within(*section: str) -> Iterator[None]:
    """Say of every wrong option in which section of the settings it stands.

    Raises:
        OptionError: the same, its key from the root of the settings.
    """
    try:
        yield
    except HistoryError:
        raise
    except OptionError as error:
        raise OptionError(str(error), (*section, *error.key), error.value, error.expected) from None
    except MonitorError as error:
        raise OptionError(str(error), section, None, str(error)) from None
