"""Parameters of attacks as people read them."""

from __future__ import annotations

import json

from dgu_sim.attacks.wording import parameter_words


def test_a_table_is_counted_and_a_vector_shown() -> None:
    """What has a thousand rows does not fill a page; what is not set is not said."""
    told = {"bias": [0.1, 0.0, 0.2], "time_sec": list(range(1000)), "rise_sec": None, "current_a": []}
    assert parameter_words(told) == ["bias 0.1 0.0 0.2", "time_sec 1000 values"]
    assert parameter_words(json.dumps({"falsify": {"kind": "freeze"}})) == ["falsify {kind freeze}"]


def test_what_is_no_document_is_said_as_it_is() -> None:
    """A bag may hold anything."""
    assert parameter_words("{broken") == ["{broken"]
    assert parameter_words("") == parameter_words("3") == []
