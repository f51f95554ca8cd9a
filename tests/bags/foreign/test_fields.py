"""Field paths, followed through the definitions that come with the data."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bags.foreign.fields import FieldPath, numeric_fields
from bags.foreign.units import factor_of
from bags.mcap.errors import BagError

TYPE = "lab_msgs/msg/Plant"


@pytest.fixture(name="definitions", scope="module")
def _definitions(store: Any) -> dict[str, Any]:  # noqa: ANN401 - of rosbags
    return {name: fields for name, (_, fields) in store.fielddefs.items()}


@pytest.mark.parametrize(
    "text", ["/plant/state.position[0]", "/a.b", "a.b", "/a-b/é.c", "/a/b_c.d_e[10].f[2]", "/x.m[1][2]"]
)
def test_paths_are_written_as_they_are_read(text: str) -> None:
    """Reading and writing a path gives the path."""
    assert str(FieldPath.parse(text)) == text


@pytest.mark.parametrize("text", ["", "/a", "/a.", "/a.b[", "/a.b[-1]", "/a.b[x]", "/a b.c", "/a..b", "/a.b[0]c"])
def test_what_is_no_path_is_one_line(text: str) -> None:
    """Anything else is an error that shows how a path is written."""
    with pytest.raises(BagError, match=r"expected a topic and a field, as in /plant/state\.position\[0\]"):
        FieldPath.parse(text)


def test_numbers_are_found_at_any_depth(definitions: dict[str, Any]) -> None:
    """Messages in arrays, arrays in messages, whole numbers and flags are numbers."""
    cell = SimpleNamespace(level=[1.0, 2.0, 3.5])
    message = SimpleNamespace(cells=[cell, cell], state=[4.0], count=7, good=True)
    for text, value in (("cells[1].level[2]", 3.5), ("state[0]", 4.0), ("count", 7.0), ("good", 1.0)):
        path = FieldPath.parse(f"/p.{text}")
        path.check(TYPE, definitions)
        assert path.read(message) == value
    with pytest.raises(BagError, match="index 1 is out of range, the message has 1 elements"):
        FieldPath.parse("/p.state[1]").read(message)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("missing", "has no field 'missing', expected one of header, cells, state, name, count, good"),
        ("name", "is a string, expected a number"),
        ("state", r"is an array of float32, expected a number, as in /p.state\[0\]"),
        ("cells[0]", "is a message lab_msgs/msg/Cell, expected a number: one of its fields level"),
        ("cells[2].level[0]", r"index 2 is out of range, /p.cells has 2 elements"),
        ("cells[0].level[3]", r"index 3 is out of range, /p.cells\[0\].level has 3 elements"),
        ("count[0]", "/p.count is a int64, expected no index behind it"),
        ("count.x", "/p.count is a int64, expected no field 'x' in it"),
        ("header.stamp", "is a message builtin_interfaces/msg/Time, expected a number: one of its fields sec, nanosec"),
    ],
)
def test_wrong_paths_say_what_is_there(definitions: dict[str, Any], text: str, what: str) -> None:
    """Each wrong path is one line that names what was found and what was expected."""
    with pytest.raises(BagError, match=what) as error:
        FieldPath.parse(f"/p.{text}").check(TYPE, definitions)
    assert "\n" not in str(error.value)


def test_whole_numbers_that_no_double_holds_are_refused() -> None:
    """Neither as fields nor in arrays is a number read that was not written; infinite ones are none."""
    path = FieldPath.parse("/a.n")
    for number in (2**53, 2**60, -(2**62), np.int64(2**53), math.inf, 1e300):
        assert path.read(SimpleNamespace(n=number)) == number
    for odd in (2**53 + 1, np.int64(2**53 + 1), np.uint64(2**63 + 1), -(2**60) - 1):
        with pytest.raises(BagError, match=r"has more digits than a double, expected a number up to 2\*\*53"):
            path.read(SimpleNamespace(n=odd))


def test_unknown_types_are_named(definitions: dict[str, Any]) -> None:
    """A type that nobody defines is an error that names it."""
    with pytest.raises(BagError, match="message type none_msgs/msg/None of /p is unknown"):
        FieldPath.parse("/p.x").check("none_msgs/msg/None", definitions)


def test_every_numeric_field_is_listed(definitions: dict[str, Any]) -> None:
    """The list for people names every number and neither header nor text."""
    assert numeric_fields(TYPE, definitions) == [".cells[0..1].level[0..2]", ".state[*]", ".count", ".good"]


def test_units() -> None:
    """Prefixes scale, and an unknown unit is told."""
    assert [factor_of(unit) for unit in ("V", "mA", "mV s", "us", "kV", "1")] == [1.0, 1e-3, 1e-3, 1e-6, 1e3, 1.0]
    with pytest.raises(BagError, match="unit 'furlong': expected one of V, A"):
        factor_of("furlong")
