"""What a person types to start an attack, and what the command says of it."""

from __future__ import annotations

import json
import shlex

import pytest
from typer.testing import CliRunner

from dcmg.attack_words import EXAMPLES, parameters_of, parse_order
from dcmg.cli import app
from dcmg.errors import CommandError
from dgu_sim.attacks import KINDS
from dgu_sim.errors import AttackError
from dgu_sim.grid import Link


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_an_example_that_is_an_order(kind: str) -> None:
    """The line that `kinds KIND` ends with is accepted, quotes taken off as a shell does."""
    order = parse_order([kind, *shlex.split(EXAMPLES[kind])])
    assert order.kind == kind
    assert order.links


def test_links_and_parameters_become_an_order() -> None:
    """Several links, several values, JSON, dashes for underscores, negative numbers."""
    order = parse_order(["zero_sum", "1-2", "5-4", "--shares", "0.5", "-0.5"])
    assert order.links == (Link(1, 2), Link(5, 4))
    assert order.parameters == {"shares": [0.5, -0.5]}
    spoof = parse_order(["spoof", "1-2", '--falsify={"kind": "bias", "bias": [0, -1, 0]}'])
    assert spoof.parameters == {"falsify": {"kind": "bias", "bias": [0.0, -1.0, 0.0]}}
    assert parse_order(["replay", "1-2", "--record-sec", "2"]).parameters == {"record_sec": 2.0}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["1-2"], "kind = '1-2': expected an attack class"),
        (["--bias", "1"], "expected a kind of attack first, one of bias"),
        (["bias", "--bias", "1", "2", "3"], "expected the attacked link behind it"),
        (["bias", "one"], "link one: expected two DGU numbers"),
        (["bias", "1-2", "--bias"], "--bias: expected a value behind it"),
        (["bias", "1-2", "--bias", "[1"], "--bias [1: expected numbers, words or JSON"),
        (["bias", "1-2", "--bias", "1", "--bias", "2"], "--bias is given twice"),
        (["bias", "1-2", "--bias", "nan", "0", "0"], "bias.0 = 'nan': expected a finite number"),
        (["covert", "1-2", "--load", "1"], "load = 1: no such key: did you mean load_a?"),
        (["luenberger_stealthy", "1-2", "--voltage-v", "1"], "expected at least two links into one DGU"),
    ],
)
def test_wrong_words_are_refused_in_one_line(words: list[str], said: str) -> None:
    """Before anything is sent."""
    with pytest.raises((CommandError, AttackError)) as caught:
        parse_order(words)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", KINDS)
def test_kinds_shows_every_parameter(kind: str) -> None:
    """One kind with its parameters, as a table and as JSON."""
    shown = CliRunner().invoke(app, ["attack", "kinds", kind], env={"COLUMNS": "200"})
    assert shown.exit_code == 0
    assert all(option in shown.output for option, _, _ in parameters_of(KINDS[kind]))
    assert f"dcmg attack start {kind} {EXAMPLES[kind]}" in shown.output
    document = json.loads(CliRunner().invoke(app, ["attack", "kinds", kind, "--json"]).output)
    assert set(document) == {kind}
    assert set(document[kind]["parameters"]["properties"]) == set(KINDS[kind].model_fields)


def test_kinds_and_the_help_of_start_name_them_all() -> None:
    """Whoever asks what there is gets every kind."""
    for arguments in (["attack", "kinds"], ["attack", "start", "--help"]):
        shown = CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})
        assert all(kind in shown.output for kind in KINDS)
