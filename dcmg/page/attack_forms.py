"""Attacks as a form: what it explains, and what is made of that which is typed."""

import re
from typing import Any

from dcmg.attack_words import EXAMPLES, first_line, parameters_of, parse_link, value_of
from dcmg.errors import CommandError
from dcmg.page.messages import Attack, AttackKind, Parameter
from dcmg.page.source import RefusalError
from dgu_sim.attacks import known_kind, usable_kinds
from dgu_sim.errors import DguSimError
from dgu_sim.grid import Link

_SEPARATOR = re.compile(r"[,\s]+")


def kinds() -> list[AttackKind]:
    """Every kind of attack with its parameters explained."""
    return [_kind(name, attack) for name, attack in usable_kinds()[0].items()]


def order_of(message: Attack) -> tuple[tuple[Link, ...], dict[str, object]]:
    """The links and the parameters of an attack as typed; several links stand among the parameters, for the relay.

    Raises:
        RefusalError: Something is no link, or no value.
    """
    try:
        links = tuple(parse_link(word) for word in message.links)
        if message.action == "stop":
            return links, {}
        known_kind(message.attack)
        parameters = {name: _value(name, text) for name, text in message.parameters.items() if text.strip()}
    except (CommandError, DguSimError) as error:
        raise RefusalError(str(error)) from error
    if len(links) > 1:
        parameters["links"] = [str(one) for one in links]
    return links, parameters


def _value(name: str, text: str) -> object:
    """YAML; numbers with spaces or commas between them are a list, with or without brackets."""
    text = text.strip()
    plain = text.strip("[]() ")
    if not any(sign in text for sign in "{:\"'") and _SEPARATOR.search(plain):
        return value_of(name, [one for one in _SEPARATOR.split(plain) if one])
    return value_of(name, [text])


def _kind(name: str, attack: Any) -> AttackKind:  # noqa: ANN401 - a class of the registry
    links, typed = _example(name)
    return AttackKind(
        name=name,
        does=first_line(attack),
        knows=str(attack.knows),
        links=links,
        parameters=[
            Parameter(
                name=option.removeprefix("--").replace("-", "_"),
                means=means,
                default="" if default == "required" else default,
                example=typed.get(option, ""),
                required=default == "required",
            )
            for option, default, means in parameters_of(attack)
        ],
    )


def _example(name: str) -> tuple[list[str], dict[str, str]]:
    """Links and typed parameters of the words that help shows."""
    head, *options = re.split(r"\s(?=--)", EXAMPLES.get(name, "1-2"))
    pairs = (one.partition(" ") for one in options)
    return head.split(), {option: text.strip("'") for option, _, text in pairs}
