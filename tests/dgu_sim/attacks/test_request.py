"""Parameters of attacks as strangers send them."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dgu_sim.attacks.request import parse_parameters
from dgu_sim.errors import AttackError


@pytest.mark.parametrize(
    "text",
    [
        '{"\\ud800": 1}',
        '{"a": "\\udfff"}',
        "[" * 3000,
        '{"a":' * 3000,
        "9" * 5000,
        '{"a": ' + "9" * 5000 + "}",
        '{"a": NaN}',
        '{"a": -Infinity}',
        "[]",
        "null",
        "{",
        "x" * 100_000,
    ],
)
def test_what_is_no_object_of_sound_values_is_refused_in_one_line(text: str) -> None:
    """No text ends the node that reads it."""
    with pytest.raises(AttackError) as caught:
        parse_parameters(text)
    assert len(str(caught.value).encode().splitlines()) == 1


@given(st.text(st.characters(codec=None), max_size=200))
def test_any_text_is_parameters_or_a_refusal(text: str) -> None:
    """Half surrogates, controls, anything: an object that can be written again, or an AttackError."""
    try:
        found = parse_parameters(text)
    except AttackError:
        return
    assert parse_parameters(json.dumps(found)) == found


def test_no_text_means_no_parameters() -> None:
    """Attacks without parameters need none."""
    assert parse_parameters("") == {}
