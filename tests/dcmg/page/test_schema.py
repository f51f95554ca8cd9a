"""One schema for both sides."""

from __future__ import annotations

import json
from importlib.resources import files

import pytest
from pydantic import ValidationError

from dcmg.page.messages import parse_client, schema

EXAMPLES = [
    {"kind": "hello", "secret": "s", "view": {"panels": ["heat"], "span_sec": 10, "pixels": 600}},
    {"kind": "view", "panels": ["1-2"], "span_sec": 0.5, "pixels": 50},
    {"kind": "clock", "id": 1, "action": "rate", "rate": 2},
    {"kind": "seek", "id": 2, "step": 5},
    {"kind": "attack", "id": 3, "action": "check", "links": ["1-2"], "attack": "freeze"},
    {"kind": "whatif", "id": 4, "links": ["1-2"], "attack": "freeze", "horizon_sec": 5},
    {"kind": "cut", "id": 5, "link": "1-2", "on": True},
    {"kind": "again", "id": 6},
]


@pytest.mark.parametrize("message", EXAMPLES, ids=lambda one: one["kind"])
def test_a_message_is_read_and_a_wrong_one_is_not(message: dict[str, object]) -> None:
    """Every kind comes through; an unknown key, and a number that is none, do not."""
    assert parse_client(json.dumps(message)).kind == message["kind"]
    with pytest.raises(ValidationError):
        parse_client(json.dumps({**message, "more": 1}))
    with pytest.raises(ValidationError):
        parse_client(json.dumps({**message, "kind": "reply"}))


def test_the_browser_sends_and_takes_the_kinds_of_the_schema_and_no_others() -> None:
    """Each kind that the schema has stands in the page's modules: neither side has grown alone."""
    static = files("dcmg.page").joinpath("static")
    text = "".join(one.read_text() for one in static.iterdir() if one.name.endswith(".js"))
    for kind in schema()["client"]["discriminator"]["mapping"]:
        assert f'kind: "{kind}"' in text, kind
    for kind in schema()["server"]["discriminator"]["mapping"]:
        assert f'kind === "{kind}"' in text, kind
