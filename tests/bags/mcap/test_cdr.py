"""Fixed-length messages against rosbags' serialiser."""

import string
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype

from bags.mcap.cdr import ENCAPSULATION, layout_of
from bags.mcap.errors import BagError
from bags.mcap.typestore import typestore

FIXED = (
    "rosgraph_msgs/msg/Clock",
    "dcmg_msgs/msg/Tick",
    "dcmg_msgs/msg/State",
    "dcmg_msgs/msg/Output",
    "dcmg_msgs/msg/Residual",
    "dcmg_msgs/msg/Alarm",
    "geometry_msgs/msg/PoseWithCovarianceStamped",  # nothing of ours: nested messages and a long array
)
_INTEGERS = {"int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1), "uint64": (0, 2**64 - 1), "uint8": (0, 255)}
_FRAMES = st.text(alphabet=string.ascii_lowercase + string.digits + "_äß", max_size=12)


def _number(primitive: str) -> st.SearchStrategy[Any]:
    if primitive == "bool":
        return st.booleans()
    if primitive == "float64":
        return st.floats(allow_nan=False)
    return st.integers(*_INTEGERS[primitive])


def _lengths(type_name: str) -> tuple[tuple[str, int], ...]:
    """Elements of each sequence of a type: none, one, two, ... in turn."""
    fields = typestore().fielddefs[type_name][1]
    return tuple((name, number) for number, (name, (kind, _)) in enumerate(fields) if kind == Nodetype.SEQUENCE)


@st.composite
def _message(draw: st.DrawFn, type_name: str, frame: str) -> tuple[object, list[object]]:
    """A rosbags message and its numbers in order."""
    fields: dict[str, Any] = {}
    flat: list[object] = []
    for name, (kind, detail) in typestore().fielddefs[type_name][1]:
        description = cast("Any", detail)
        if kind == Nodetype.NAME:
            fields[name], numbers = draw(_message(description, frame))
            flat += numbers
        elif kind == Nodetype.BASE and description[0] == "string":
            fields[name] = frame
        elif kind == Nodetype.BASE:
            fields[name] = draw(_number(description[0]))
            flat.append(fields[name])
        else:
            (_, (primitive, _)), count = description
            count = dict(_lengths(type_name)).get(name, count)
            numbers = draw(st.lists(_number(primitive), min_size=count, max_size=count))
            fields[name] = np.array(numbers)
            flat += numbers
    return cast("Any", typestore().types[type_name])(**fields), flat


def test_sequences_of_constant_length_are_those_of_rosbags() -> None:
    """With the numbers of elements given, a message with sequences has the bytes of rosbags' serialiser."""
    type_name = "dcmg_msgs/msg/TeamEstimate"
    names = ("alarm", "estimate", "disagreement", "threshold")
    layout = layout_of(type_name, "dgu_12", tuple(zip(names, (2, 6, 6, 6), strict=True)))
    numbers = [1, 2, 3, 4, 2, True, False, *(0.5 * one for one in range(18))]
    data = layout.pack(*numbers)
    message = typestore().deserialize_cdr(data, type_name)
    assert bytes(typestore().serialize_cdr(message, type_name)) == data
    assert list(layout.unpack(data)) == numbers
    assert np.frombuffer(data, layout.dtype)["disagreement"].tolist() == [[3.0, 3.5, 4.0, 4.5, 5.0, 5.5]]
    with pytest.raises(BagError, match="alarm has no fixed length"):
        layout_of(type_name)


@pytest.mark.parametrize("type_name", FIXED)
@settings(max_examples=30, deadline=None)  # seven types
@given(data=st.data(), frame=_FRAMES)
def test_bytes_equal_those_of_rosbags(type_name: str, data: st.DataObject, frame: str) -> None:
    """Packed bytes are those of rosbags (and so of Fast CDR) for all values, and unpack gives the values back."""
    message, flat = data.draw(_message(type_name, frame))
    layout = layout_of(type_name, frame, _lengths(type_name))
    packed = layout.pack(*flat)
    assert packed == bytes(typestore().serialize_cdr(message, type_name, little_endian=True))
    assert layout.size == len(packed) == layout.dtype.itemsize
    assert list(layout.unpack(packed)) == flat


@pytest.mark.parametrize("type_name", FIXED)
@settings(max_examples=30, deadline=None)  # seven types
@given(data=st.data(), frame=_FRAMES)
def test_numpy_sees_the_same_fields(type_name: str, data: st.DataObject, frame: str) -> None:
    """The dtype finds in the bytes what was packed, and a filled template has the bytes of pack."""
    _, flat = data.draw(_message(type_name, frame))
    layout = layout_of(type_name, frame, _lengths(type_name))
    seen = np.frombuffer(layout.pack(*flat), dtype=layout.dtype)
    assert np.concatenate([np.atleast_1d(seen[0][name]).astype(object) for name in layout.names]).tolist() == flat
    block = layout.template(2)
    for name in layout.names:
        block[name] = seen[name]
    assert block.tobytes() == layout.pack(*flat) * 2


def test_names_are_dotted() -> None:
    """Nested fields carry their path, arrays count once, the string is not among the packed fields."""
    layout = layout_of("dcmg_msgs/msg/Output", "dgu_1", (("y", 3), ("u", 0)))
    assert layout.names == ("header.stamp.sec", "header.stamp.nanosec", "step", "source", "delivered", "y", "u")
    assert (layout.dtype["y"].shape, layout.dtype["u"].shape) == ((3,), (0,))
    assert layout.template(1)["header.frame_id"][0] == b"dgu_1"


@pytest.mark.parametrize("change", [lambda data: data + b"\0", lambda data: data[:-1], lambda data: b"\0\0" + data[2:]])
def test_other_bytes_are_refused(change: Any) -> None:  # noqa: ANN401 - a function on bytes
    """Another length or encoding is an error that says what was found and expected."""
    layout = layout_of("dcmg_msgs/msg/Tick")
    with pytest.raises(
        BagError, match=rf"dcmg_msgs/msg/Tick: found .* expected 28 starting with {ENCAPSULATION[:2].hex(' ')}"
    ):
        layout.unpack(change(layout.pack(1, 2, 3)))


@pytest.mark.parametrize(
    ("type_name", "what"),
    [
        ("dcmg_msgs/msg/History", "field u has no fixed length"),
        ("dcmg_msgs/msg/Design", "expected at most one"),
        ("dcmg_msgs/msg/Nothing", "is unknown"),
    ],
)
def test_types_of_varying_length_are_refused(type_name: str, what: str) -> None:
    """A sequence, a second string or an unknown type has no layout."""
    with pytest.raises(BagError, match=what):
        layout_of(type_name)
